"""Arrays in the file of a state: their bytes behind a plain type, and nothing else.

NumPy's own way to pickle lets a file state sizes and flags that are not those of the bytes, which
crashes the process or worse. These functions check both.
"""

import copyreg
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import ArtifactError

# Truth values, numbers, moments and texts of a fixed length.
_PLAIN = frozenset("biufcmMSU")


def plain_type(text: str) -> np.dtype[Any]:
    """Return a type of plain values.

    Raises:
        ArtifactError: It is another.
    """
    found = np.dtype(str(text))
    if found.kind not in _PLAIN:
        raise ArtifactError(f"arrays of {found} can't be kept in a file: keep plain ones")
    return found


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
    shaped = np.array(values).reshape(tuple(shape), order="F" if order == "F" else "C")
    shaped.setflags(write=bool(is_writable))
    return shaped


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
    content = array.tobytes(order)
    return plain_array, (text, array.shape, content, order, array.flags.writeable)


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
"""How arrays, their values and their types are written, for a pickler's `dispatch_table`."""
