"""Rooms: the passages between them, the chambers that these cut out, and names and types."""
