"""The Python interface of the compiled core: arrays and integers in, arrays and integers out.

There is one module for each subject, as in ``src/core``. It has the named tuples of the subject
with their shapes and units, its constants, and its functions from :mod:`fleet2d._core`.

The types of arrays, which the whole project uses, are named by their elements: `I64` is an array
of int64 of any shape, `F64` one of float64, `Bool` one of booleans.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["F32", "F64", "I8", "I16", "I32", "I64", "U8", "U64", "Bool"]

Bool = NDArray[np.bool_]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I8 = NDArray[np.int8]
I16 = NDArray[np.int16]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U64 = NDArray[np.uint64]
