"""The compiled core as Python sees it: arrays and integers in, arrays and integers out.

One module a subject, as in ``src/core``: its named tuples with their shapes and units, its
constants, and its functions, which :mod:`fleet2d._core` holds.
"""
