"""Every compiled function: arrays and integers in, arrays and integers out.

This package imports numpy, numba and itself, nothing else; the import contract in
``pyproject.toml`` keeps it so. Coordinates are lattice units (int64), headings are 1/4096 of a
turn, times are microseconds, random bits come from :mod:`fleet2d.kernels.random`.
"""
