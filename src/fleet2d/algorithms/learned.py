"""What an algorithm has learned, as a file that another run can start from."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from fleet2d.bounds import LEARNED_BYTES, check_file, one_line
from fleet2d.errors import ComponentError, InputError

# Between the names of a nested mapping, in the names of the file's arrays.
BELOW = "/"


def save_learned(state: Mapping[str, Any], path: Path, where: str) -> None:
    """Write what an algorithm remembers: arrays, numbers and texts, in mappings of any depth.

    Args:
        state: What `Algorithm.remember` returned.
        path: The file to write, .npz as NumPy reads it.
        where: The algorithm's path in the scenario, for errors.

    Raises:
        ComponentError: It holds something else, which is named.
    """
    arrays = dict(_flat(state, "", where))
    with path.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def load_learned(path: Path) -> dict[str, Any]:
    """Read what an algorithm remembered: mappings of arrays; numbers and texts as themselves.

    Raises:
        InputError: It is no such file.
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
            *above, last = name.split(BELOW)
            here = state
            for key in above:
                here = here.setdefault(key, {})
            here[last] = array if array.ndim else array.item()
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001 - a damaged archive raises almost anything
        raise InputError(
            f"{path}: this is not what an algorithm has learned ({one_line(error, 100)}); give a"
            " file .npz of the folder learned/ of a run"
        ) from None
    return state


def _plain(value: Any, name: str) -> NDArray[Any]:
    """Return an array of plain values; NumPy hands on whatever else is in the archive."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biufU":
        raise ValueError(f"{name!r} is no array of numbers, truth values or texts")
    return value


def run_state(component: Any) -> dict[str, Any]:
    """Return the attributes of a component that aren't its configuration."""
    fields = type(component).model_fields
    return {name: value for name, value in vars(component).items() if name not in fields}


def check_shapes(now: Mapping[str, Any], before: Mapping[str, Any], where: str) -> None:
    """Refuse arrays of other shapes than those that `start` has made: of another home.

    Raises:
        ComponentError: One doesn't fit.
    """
    for name, value in before.items():
        made = now.get(name)
        if isinstance(value, Mapping) and isinstance(made, Mapping):
            check_shapes(made, value, where)
            continue
        check_numbers(name, value, where)
        if isinstance(made, np.ndarray) and made.size and np.shape(value) != made.shape:
            raise ComponentError(
                f"{where}: what was learned has {name!r} of shape {np.shape(value)}, but this home"
                f" and its users make {made.shape}: it was learned somewhere else"
            )


def array_of(
    learned: Mapping[str, Any],
    name: str,
    shape: tuple[int, ...],
    kind: type[np.generic] = np.float64,
    most: float = 1e300,
) -> NDArray[Any]:
    """Return an array of what was learned, a copy.

    Args:
        learned: What was learned.
        name: Of the array.
        shape: Its shape; -1 for any length above 0.
        kind: Its type.
        most: Its numbers are from -most to most.

    Raises:
        ComponentError: It is missing, of another shape, or holds what is no number.
    """
    found = np.asarray(learned.get(name, ()))
    fits = found.ndim == len(shape) and all(
        size == wanted or wanted < 0 < size for size, wanted in zip(found.shape, shape, strict=True)
    )
    if not fits or found.dtype.kind not in "biuf" or not (np.abs(found) <= most).all():
        raise ComponentError(
            f"what was learned has no {name!r} of shape {shape}, of numbers alone: it is damaged,"
            " or from another home, other users or another estimator"
        )
    return np.array(found, kind)


def check_numbers(name: str, value: Any, where: str) -> None:
    """Refuse what is no number among those that were learned.

    Raises:
        ComponentError: There is a NaN.
    """
    if isinstance(value, Mapping):
        for inner, entry in value.items():
            check_numbers(f"{name}{BELOW}{inner}", entry, where)
    elif np.asarray(value).dtype.kind == "f" and np.isnan(value).any():
        raise ComponentError(f"{where}: what was learned has NaN in {name!r}: it is damaged")


def _flat(state: Mapping[str, Any], above: str, where: str) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, value in state.items():
        path = f"{above}{name}"
        if BELOW in str(name) or not name:
            raise ComponentError(f"{where} remembers {name!r}: a name without {BELOW!r} is wanted")
        if isinstance(value, Mapping):
            yield from _flat(value, f"{path}{BELOW}", where)
            continue
        array = np.asarray(value)
        if array.dtype.kind not in "biufU":
            raise ComponentError(
                f"{where} remembers {path!r}, which is a {type(value).__name__}: arrays, numbers"
                " and texts can be kept. Write remember() and recall() for the rest"
            )
        yield path, array
