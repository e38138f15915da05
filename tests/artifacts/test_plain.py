"""Values become plain JSON data."""

import datetime as dt
from pathlib import Path

import numpy as np

from fleet2d.artifacts.plain import plain


def test_plain_has_words_for_what_models_hold() -> None:
    given = {
        "n": np.int32(3),
        "a": np.array([1.5, np.nan]),
        "d": dt.date(2026, 1, 5),
        "t": dt.timedelta(minutes=1),
        "p": Path("a"),
        "s": {"b", "a"},
        1: (True, None),
    }

    expected = {
        "n": 3,
        "a": [1.5, None],
        "d": "2026-01-05",
        "t": 60.0,
        "p": "a",
        "s": ["a", "b"],
        "1": [True, None],
    }
    assert expected == plain(given)
