"""Plain JSON data: what manifests and other files of a run consist of."""

import datetime as dt
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Convert a value to plain JSON data: NaN and infinity become null.

    Example:
        >>> plain({"mean": float("nan"), "at": dt.timedelta(hours=1), 3: (1, 2)})
        {'mean': None, 'at': 3600.0, '3': [1, 2]}
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(plain(entry) for entry in value)
    if isinstance(value, Sequence):
        return [plain(entry) for entry in value]
    if isinstance(value, dt.timedelta):
        return value.total_seconds()
    if isinstance(value, dt.date | dt.time):
        return value.isoformat()
    return str(value)


def canonical(content: Mapping[str, Any]) -> str:
    """Return the one text that a manifest of some content has: its keys are sorted.

    Only the keys within sections of the scenario stay in their order, which has an effect: users,
    for example, decide in the order in which they are listed.
    """
    ordered = _sorted({key: value for key, value in content.items() if key != "scenario"})
    if "scenario" in content:
        ordered["scenario"] = dict(sorted(content["scenario"].items()))
    return json.dumps(dict(sorted(ordered.items())), indent=2, allow_nan=False) + "\n"


def _sorted(value: Any) -> Any:
    """Return plain data with all keys sorted."""
    if isinstance(value, Mapping):
        return {key: _sorted(value[key]) for key in sorted(value)}
    return [_sorted(entry) for entry in value] if isinstance(value, list) else value
