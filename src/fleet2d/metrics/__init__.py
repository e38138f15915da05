"""What measures a run: one metric a module."""
