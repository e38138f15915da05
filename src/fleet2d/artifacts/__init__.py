"""What a run stores: tables, digests, manifest, run directory."""
