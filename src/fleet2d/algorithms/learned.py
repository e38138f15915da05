"""What an algorithm has learned, as a file that another run can start from."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

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
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, AttributeError, TypeError, BadZipFile) as error:
        raise InputError(
            f"{path}: this is not what an algorithm has learned ({error}); give a file .npz of the"
            " folder learned/ of a run"
        ) from None
    for name, array in arrays.items():
        *above, last = name.split(BELOW)
        here = state
        for key in above:
            here = here.setdefault(key, {})
        here[last] = array if array.ndim else array.item()
    return state


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
        elif isinstance(made, np.ndarray) and made.size and np.shape(value) != made.shape:
            raise ComponentError(
                f"{where}: what was learned has {name!r} of shape {np.shape(value)}, but this home"
                f" and its users make {made.shape}: it was learned somewhere else"
            )


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
