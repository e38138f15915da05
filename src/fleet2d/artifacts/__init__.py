"""Stored runs: tables, digests, manifest, run directory."""
