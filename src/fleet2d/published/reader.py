"""Readers of old configurations, key by key, which collect remarks and note unknown keys."""

import math
from collections.abc import Mapping
from datetime import timedelta
from typing import Any

from pydantic_core import PydanticCustomError

from fleet2d.configuration.documents import Document, Keys
from fleet2d.configuration.problems import shown
from fleet2d.configuration.units import parse_duration
from fleet2d.errors import ScenarioError

_HUGE = 1e300
_UNITS = {"weeks", "days", "hours", "minutes", "seconds", "milliseconds", "microseconds"}
_BOOLEANS = {"yes": True, "on": True, "no": False, "off": False}  # of YAML 1.1, as it is read there


class ConfigReader:
    """A reader of an old configuration: checks values, collects remarks, and notes unread keys."""

    def __init__(self, document: Document, shown_as: str) -> None:
        self.document = document
        self.shown_as = shown_as
        self._touched: set[Keys] = set()
        self._whole: set[Keys] = set()  # read together with all keys below them
        self._remarks: dict[str, list[str]] = {}

    def check_kind(self) -> None:
        """Raise ScenarioError unless this looks like a configuration of the published Fleet2D."""
        sections = ("simulation", "floorplan")
        wrong = [s for s in sections if not isinstance(self.document.data.get(s), Mapping)]
        if wrong:
            raise ScenarioError(
                f"{self.shown_as} is not a configuration of the published Fleet2D, whose sections"
                f" are simulation, floorplan, users and robot: there is no section {wrong[0]}"
            )
        if "start" in self.document.data["simulation"] or "path" in self.document.data["floorplan"]:
            raise ScenarioError(
                f"{self.shown_as} is a scenario already: run it with `fleet2d run {self.shown_as}`"
            )

    def remark(self, keys: Keys, text: str, *also: Keys) -> None:
        """Add a remark on one or more keys; equal texts are reported once, with all their keys."""
        self._remarks.setdefault(text, []).extend(".".join(path) for path in (keys, *also))

    def finish(self) -> list[str]:
        """Return all remarks, with those about unknown keys last."""
        self._note_unknown(self.document.data, ())
        return [f"{', '.join(dict.fromkeys(k))}: {text}" for text, k in self._remarks.items()]

    def _note_unknown(self, data: Mapping[str, Any], above: Keys) -> None:
        for key, value in data.items():
            keys = (*above, key)
            if keys not in self._touched and keys not in self._whole:
                self.remark(keys, f"not known, left out ({self.document.place(keys)})")
            elif keys not in self._whole and isinstance(value, Mapping):
                self._note_unknown(value, keys)

    def wrong(self, keys: Keys, message: str) -> ScenarioError:
        """Return the error about a key."""
        return ScenarioError(f"{self.document.place(keys)}: {'.'.join(keys)}: {message}")

    def get(self, keys: Keys, *, whole: bool = False) -> Any:
        """Return a value, None if it is missing; with `whole`, all keys below it count as read."""
        data: Any = self.document.data
        for depth, key in enumerate(keys):
            if data is None:
                return None
            if not isinstance(data, Mapping):
                raise self.wrong(keys[:depth], f"expected a mapping of keys, got {shown(data)}")
            self._touched.add(keys[: depth + 1])
            data = data.get(key)
        if whole:
            self._whole.add(keys)
        return data

    def number(
        self, keys: Keys, above: float = -math.inf, least: float = -math.inf, most: float = math.inf
    ) -> float | None:
        """Return a finite number within limits, or None."""
        value = self.get(keys)
        if value is None:
            return None
        expected = "a number"
        expected += f" above {above:g}" if above > -math.inf else ""
        expected += f" of {least:g} or more" if least > -math.inf else ""
        expected += f", {most:g} at most" if most < math.inf else ""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not (abs(value) < _HUGE and above < value <= most and value >= least):
            raise self.wrong(keys, f"expected {expected}, got {shown(value)}")
        return float(value)

    def integer(self, keys: Keys, least: int, below: int = 2**63) -> int | None:
        """Return a whole number; None if the key is missing."""
        value = self.get(keys)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value < below:
            raise self.wrong(
                keys, f"expected a whole number of {least} or more, got {shown(value)}"
            )
        return value

    def text(self, keys: Keys) -> str | None:
        """Return a text; None if it is missing or empty."""
        value = self.get(keys)
        if value is not None and not isinstance(value, str):
            raise self.wrong(keys, f"expected text, got {shown(value)}")
        return str(value) if value else None

    def boolean(self, keys: Keys) -> bool | None:
        """Return true or false, or None."""
        value = self.get(keys)
        value = _BOOLEANS.get(value.lower(), value) if isinstance(value, str) else value
        if value is not None and not isinstance(value, bool):
            raise self.wrong(keys, f"expected true or false, got {shown(value)}")
        return value

    def duration(self, keys: Keys) -> timedelta | None:
        """Return the sum of a mapping of units to numbers as a duration, or None."""
        value = self.get(keys, whole=True)
        if value is None:
            return None
        if not isinstance(value, Mapping) or not value.keys() <= _UNITS:
            raise self.wrong(
                keys, f"expected a mapping of {', '.join(sorted(_UNITS))}, got {shown(value)}"
            )
        try:
            return parse_duration(dict(value) or 0)
        except PydanticCustomError as error:
            raise self.wrong(keys, error.message()) from None


def tidy(value: float) -> float:
    """Return a computed number rounded to 12 significant digits."""
    return float(f"{value:.12g}")
