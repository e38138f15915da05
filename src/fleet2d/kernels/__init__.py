"""The Python interface of the compiled core: arrays and integers in, arrays and integers out.

There is one module for each subject, as in ``src/core``. It has the named tuples of the subject
with their shapes and units, its constants, and its functions from :mod:`fleet2d._core`.
"""
