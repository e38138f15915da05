"""Arrays in files of states: a plain type and the bytes.

NumPy's own pickle format trusts the sizes and flags in a file, so that a wrong file can crash the
process or worse. These functions check them.
"""

import copyreg
import pickle
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import ArtifactError

# Booleans, numbers, times and text of a fixed length.
_PLAIN = frozenset("biufcmMSU")
# Arrays of fewer bytes are copied when they are written.
_SMALL_BYTES = 4096


def plain_type(text: str) -> np.dtype[Any]:
    """Return a type of plain values.

    Raises:
        ArtifactError: It is another type.
    """
    dtype = np.dtype(str(text))
    if dtype.kind not in _PLAIN:
        raise ArtifactError(f"arrays of {dtype} can't be stored in a file: use a plain type")
    return dtype


def plain_array(
    text: str, shape: Sequence[int], content: bytes, order: str, is_writable: bool
) -> NDArray[Any]:
    """Return an array of plain values from its bytes.

    Example:
        >>> plain_array("<i4", (2,), bytes(8), "C", True)
        array([0, 0], dtype=int32)
    """
    kind = plain_type(text)
    values = np.frombuffer(bytes(content), kind) if content else np.empty(0, kind)
    array = np.array(values).reshape(tuple(shape), order="F" if order == "F" else "C")
    array.setflags(write=bool(is_writable))
    return array


def object_array(shape: Sequence[int], content: Sequence[Any]) -> NDArray[Any]:
    """Return an array of Python objects."""
    values = np.empty(len(content), object)
    values[:] = content
    return values.reshape(tuple(shape))


def plain_scalar(text: str, content: bytes) -> Any:
    """Return a single value of a plain type."""
    return np.frombuffer(bytes(content), plain_type(text))[0]


def _reduce_array(array: NDArray[Any]) -> tuple[Any, ...]:
    if array.dtype == object:
        return object_array, (array.shape, list(array.ravel()))
    text = plain_type(array.dtype.str).str
    order: Literal["C", "F"] = (
        "F" if array.flags.f_contiguous and not array.flags.c_contiguous else "C"
    )
    return plain_array, (text, array.shape, _content(array, order), order, array.flags.writeable)


def _content(array: NDArray[Any], order: Literal["C", "F"]) -> bytes | pickle.PickleBuffer:
    """Return the bytes of an array; those of a large one are not copied."""
    if array.nbytes < _SMALL_BYTES or not (array.flags.c_contiguous or array.flags.f_contiguous):
        return array.tobytes(order)
    view = array.ravel(order).view(np.uint8)
    view.setflags(write=False)  # else it would be stored as a bytearray
    return pickle.PickleBuffer(view.data)


def _reduce_scalar(value: Any) -> tuple[Any, ...]:
    return plain_scalar, (plain_type(value.dtype.str).str, value.tobytes())


def _reduce_type(kind: np.dtype[Any]) -> tuple[Any, ...]:
    return plain_type, (plain_type(kind.str).str,)


def _reducers() -> dict[type, Any]:
    scalars = set(np.sctypeDict.values())
    types = {type(np.dtype(scalar)) for scalar in scalars - {np.void, np.object_}}
    return {
        **copyreg.dispatch_table,
        np.ndarray: _reduce_array,
        **dict.fromkeys(scalars - {np.void, np.object_}, _reduce_scalar),
        **dict.fromkeys(types, _reduce_type),
    }


REDUCERS = _reducers()
"""The `dispatch_table` of a pickler for arrays, their values and their types."""
