"""Homes: their walls, the free space between them, and its rooms.

Import from the modules: `plan` has `FloorPlan`, `rooms` has `Room`, and each file format that a
plan is read from is a module of its own (`houseexpo`, `ros`, `valetudo`, `native`).
"""
