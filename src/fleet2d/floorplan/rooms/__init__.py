"""Rooms: the passages between them, the chambers these cut out, and what each room is called."""
