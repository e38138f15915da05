"""Files with the learned state of an algorithm, from which another run can start."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from fleet2d.bounds import LEARNED_BYTES, check_file, one_line
from fleet2d.errors import ComponentError, InputError

# Joins the names of nested mappings in the names of the file's arrays.
SEPARATOR = "/"


def save_learned(state: Mapping[str, Any], path: Path, where: str) -> None:
    """Write the learned state of an algorithm: arrays, numbers and texts in nested mappings.

    Args:
        state: The return value of `Algorithm.remember`.
        path: The file to write, .npz as NumPy reads it.
        where: The algorithm's path in the scenario, for errors.

    Raises:
        ComponentError: It has a value of another type; the message names it.
    """
    arrays = dict(_flat(state, "", where))
    with path.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def load_learned(path: Path) -> dict[str, Any]:
    """Read the learned state of an algorithm: nested mappings of arrays, numbers and texts.

    Raises:
        InputError: The file is damaged, or holds no learned state.
    """
    state: dict[str, Any] = {}
    try:
        check_file(path, LEARNED_BYTES)
        with path.open("rb") as opened, ZipFile(opened) as file:
            unpacked = sum(entry.file_size for entry in file.infolist())
            LEARNED_BYTES.check(unpacked, path)
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as content:
            arrays = {name: _plain(content[name], name) for name in content.files}
        for name, array in arrays.items():
            *parents, last = name.split(SEPARATOR)
            mapping = state
            for key in parents:
                mapping = mapping.setdefault(key, {})
            mapping[last] = array if array.ndim else array.item()
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001 - a damaged archive raises almost anything
        raise InputError(
            f"{path} is not a file of learned state ({one_line(error, 100)}): give a .npz file of"
            " the folder learned/ of a run"
        ) from None
    return state


def _plain(value: Any, name: str) -> NDArray[Any]:
    """Return an array of plain values; refuse other entries of the archive."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biufU":
        raise ValueError(f"{name!r} is not an array of numbers, truth values or texts")
    return value


def run_state(component: Any) -> dict[str, Any]:
    """Return the attributes of a component that are not configuration."""
    fields = type(component).model_fields
    return {name: value for name, value in vars(component).items() if name not in fields}


def check_shapes(initial: Mapping[str, Any], learned: Mapping[str, Any], where: str) -> None:
    """Refuse learned arrays whose shapes differ from those that `start` made.

    Raises:
        ComponentError: A shape differs, as of another home; or there is a NaN.
    """
    for name, value in learned.items():
        start = initial.get(name)
        if isinstance(value, Mapping) and isinstance(start, Mapping):
            check_shapes(start, value, where)
            continue
        check_numbers(name, value, where)
        if isinstance(start, np.ndarray) and start.size and np.shape(value) != start.shape:
            raise ComponentError(
                f"{where}: the learned state has {name!r} of shape {np.shape(value)}, but this home"
                f" and its users need {start.shape}: it was learned in another home"
            )


def array_of(
    learned: Mapping[str, Any],
    name: str,
    shape: tuple[int, ...],
    kind: type[np.generic] = np.float64,
    most: float = 1e300,
) -> NDArray[Any]:
    """Return a copy of an array of a learned state.

    Args:
        learned: The learned state.
        name: Name of the array.
        shape: The shape it must have; -1 for any length above 0.
        kind: Type of the returned array.
        most: The largest absolute value allowed.

    Raises:
        ComponentError: It is missing, of another shape, or not of finite numbers.
    """
    array = np.asarray(learned.get(name, ()))
    fits = array.ndim == len(shape) and all(
        size == expected or expected < 0 < size
        for size, expected in zip(array.shape, shape, strict=True)
    )
    if not fits or array.dtype.kind not in "biuf" or not (np.abs(array) <= most).all():
        raise ComponentError(
            f"the learned state lacks a numeric array {name!r} of shape {shape}: it is damaged, or"
            " from another home, other users or another estimator"
        )
    return np.array(array, kind)


def check_numbers(name: str, value: Any, where: str) -> None:
    """Refuse NaN in a learned state.

    Raises:
        ComponentError: There is a NaN.
    """
    if isinstance(value, Mapping):
        for inner, entry in value.items():
            check_numbers(f"{name}{SEPARATOR}{inner}", entry, where)
    elif np.asarray(value).dtype.kind == "f" and np.isnan(value).any():
        raise ComponentError(f"{where}: the learned state has NaN in {name!r}: it is damaged")


def _flat(state: Mapping[str, Any], above: str, where: str) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, value in state.items():
        path = f"{above}{name}"
        if SEPARATOR in str(name) or not name:
            raise ComponentError(
                f"{where}: remember() returned the name {name!r}: names can't contain {SEPARATOR!r}"
            )
        if isinstance(value, Mapping):
            yield from _flat(value, f"{path}{SEPARATOR}", where)
            continue
        array = np.asarray(value)
        if array.dtype.kind not in "biufU":
            raise ComponentError(
                f"{where}: remember() returned {path!r}, a {type(value).__name__}: only arrays,"
                " numbers and texts can be stored; write remember() and recall() that convert it"
            )
        yield path, array
