"""Read a configuration of another program, key by key, and keep track of what came of each."""

import math
from collections.abc import Mapping
from datetime import timedelta
from typing import Any

from pydantic_core import PydanticCustomError

from fleet2d.document import Document, Keys
from fleet2d.errors import ScenarioError
from fleet2d.problems import shown
from fleet2d.units import parse_duration

_HUGE = 1e300
_UNITS = {"weeks", "days", "hours", "minutes", "seconds", "milliseconds", "microseconds"}
_TRUTHS = {"yes": True, "on": True, "no": False, "off": False}  # in YAML 1.1, as it is read there


class Reader:
    """An old configuration: checks what is read, notes what never is, and collects remarks."""

    def __init__(self, document: Document, shown_as: str) -> None:
        self.document = document
        self.shown_as = shown_as
        self._touched: set[Keys] = set()
        self._whole: set[Keys] = set()  # read or refused with all that is in them
        self._remarks: dict[str, list[str]] = {}

    def check_kind(self) -> None:
        """Raise ScenarioError unless this looks like a configuration of the published Fleet2D."""
        sections = ("simulation", "floorplan")
        wrong = [s for s in sections if not isinstance(self.document.data.get(s), Mapping)]
        if wrong:
            raise ScenarioError(
                f"{self.shown_as} is no configuration of the published Fleet2D: that has the"
                f" sections simulation, floorplan, users and robot, and here is no {wrong[0]}"
            )
        if "start" in self.document.data["simulation"] or "path" in self.document.data["floorplan"]:
            raise ScenarioError(
                f"{self.shown_as} is a scenario already: run it with `fleet2d run {self.shown_as}`"
            )

    def remark(self, keys: Keys, text: str, *also: Keys) -> None:
        """Note a remark about a key, and others; the same text is said once for all its keys."""
        self._remarks.setdefault(text, []).extend(".".join(path) for path in (keys, *also))

    def finish(self) -> list[str]:
        """Return all remarks, those about keys that nobody asked for last."""
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
        """Make the error about a key."""
        return ScenarioError(f"{self.document.place(keys)}: {'.'.join(keys)}: {message}")

    def get(self, keys: Keys, *, whole: bool = False) -> Any:
        """Return a value, None if it is missing; `whole` says that its inside is read with it."""
        data: Any = self.document.data
        for depth, key in enumerate(keys):
            if data is None:
                return None
            if not isinstance(data, Mapping):
                raise self.wrong(keys[:depth], f"found {shown(data)}; a mapping of keys is wanted")
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
        wanted = "a number"
        wanted += f" above {above:g}" if above > -math.inf else ""
        wanted += f" of {least:g} or more" if least > -math.inf else ""
        wanted += f", {most:g} at most" if most < math.inf else ""
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not (abs(value) < _HUGE and above < value <= most and value >= least):
            raise self.wrong(keys, f"found {shown(value)}; {wanted} is wanted")
        return float(value)

    def integer(self, keys: Keys, least: int, below: int = 2**63) -> int | None:
        """Return a whole number, or None."""
        value = self.get(keys)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value < below:
            raise self.wrong(
                keys, f"found {shown(value)}; a whole number from {least} on is wanted"
            )
        return value

    def text(self, keys: Keys) -> str | None:
        """Return a text, or None; an empty one is none."""
        value = self.get(keys)
        if value is not None and not isinstance(value, str):
            raise self.wrong(keys, f"found {shown(value)}; text is wanted")
        return str(value) if value else None

    def truth(self, keys: Keys) -> bool | None:
        """Return true or false, or None."""
        value = self.get(keys)
        value = _TRUTHS.get(value.lower(), value) if isinstance(value, str) else value
        if value is not None and not isinstance(value, bool):
            raise self.wrong(keys, f"found {shown(value)}; true or false is wanted")
        return value

    def duration(self, keys: Keys) -> timedelta | None:
        """Return the sum of a mapping of units, or None."""
        value = self.get(keys, whole=True)
        if value is None:
            return None
        if not isinstance(value, Mapping) or not value.keys() <= _UNITS:
            raise self.wrong(keys, f"a mapping of {', '.join(sorted(_UNITS))} is wanted")
        try:
            return parse_duration(dict(value) or 0)
        except PydanticCustomError as error:
            raise self.wrong(keys, error.message()) from None


def tidy(value: float) -> float:
    """Return a computed number without the dust of its last digits."""
    return float(f"{value:.12g}")
