"""What robots see: cameras, and the region that is visible from a place."""
