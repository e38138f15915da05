"""Homes: their walls, the free space between them, and its rooms.

Import from the modules: `plan` has `FloorPlan`, `rooms.room` has `Room`, `home` has `Home`, and
`native` our own file format.
"""
