"""JSON by the standard: no NaN, no repeated key, no number beyond a float."""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn


def read_json(text: bytes) -> Any:
    """Return the content of a JSON text.

    Raises:
        ValueError: It is not JSON, or is nested too deeply.

    Example:
        >>> read_json(b'{"steps": 3}')
        {'steps': 3}
        >>> read_json(b'{"steps": 3, "steps": 4}')
        Traceback (most recent call last):
        ValueError: the key 'steps' is given twice
    """
    try:
        return json.loads(
            text.decode(),
            object_pairs_hook=_unique_keys,
            parse_constant=_refuse_constant,
            parse_float=_finite_float,
        )
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        keys = [key for key, _ in pairs]
        repeated_key = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {repeated_key[:60]!r} is given twice")
    return content


def _refuse_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")


def _finite_float(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:60]} is too large a number")
    return number
