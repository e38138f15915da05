"""A floor plan in use: what stands in it now, and where bodies have space and routes."""
