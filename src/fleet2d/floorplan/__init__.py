"""Homes: their walls, the free space between them, and its rooms.

Import from the modules: `plan` has `FloorPlan`, `rooms.room` has `Room`, `home.home` has `Home`,
and `formats` has a module for each file format.
"""
