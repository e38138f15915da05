"""Types for the fields of a configuration: quantities with units, paths, days of the week.

Each quantity reads a number in SI units (angles: degrees; durations need a unit) or text with a
unit, converts it exactly, and refuses values that are not finite. Models dump to JSON in the
canonical spelling.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import time, timedelta
from decimal import Decimal
from fractions import Fraction
from functools import partial
from numbers import Real
from pathlib import Path
from typing import Annotated, Any, Literal, Self
from urllib.parse import SplitResult, urlsplit

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, WithJsonSchema
from pydantic_core import PydanticCustomError

from fleet2d.bounds import one_line
from fleet2d.configuration.problems import did_you_mean, problem, shown
from fleet2d.errors import InputError, ScenarioError, errors_as
from fleet2d.inputs import resolved
from fleet2d.runtime.clock import DAY_S, HOUR_S


class Text(str):
    """A string from a scenario, with the folder of its file."""

    __slots__ = ("folder",)
    folder: Path

    def __new__(cls, text: str, folder: Path) -> Self:
        """Attach ``folder`` to ``text``."""
        self = super().__new__(cls, text)
        self.folder = folder
        return self

    def __getnewargs__(self) -> tuple[str, Path]:  # type: ignore[override]
        """Preserve the folder in copies and pickles."""
        return str(self), self.folder


def folder_of(text: object) -> Path:
    """Return the folder that a relative path starts from.

    >>> folder_of(Text("plan.json", Path("/homes")))
    PosixPath('/homes')
    """
    return text.folder if isinstance(text, Text) else Path.cwd()


def named_path(name: str | Path) -> Path:
    """Return the path of an input file; a relative one starts from the folder of its text.

    Raises:
        PydanticCustomError: The path leads out of the root of input files, no file can have such a
            name, or it begins with the home of an unknown user.
    """
    with errors_as(problem, of=(InputError, RuntimeError)):
        path = folder_of(name) / Path(name).expanduser()
        resolved(path)
    return path


def _existing(value: object, *, is_folder_allowed: bool = False) -> Path:
    kind = "file or folder" if is_folder_allowed else "file"
    if not isinstance(value, str | Path) or not str(value):
        raise problem(f"expected the path of a {kind}, got {shown(value)}")
    path = named_path(value).resolve()
    if not (path.is_file() or (is_folder_allowed and path.is_dir())):
        reason = "a folder, not a file" if path.is_dir() else f"no such {kind}"
        raise problem(f"{reason}: {path}")
    return path


_SCHEMA = WithJsonSchema(
    {
        "type": "string",
        "description": "path, relative to the file it is written in",
        "x-quantity": "path",
    }
)

InputPath = Annotated[Path, BeforeValidator(_existing), _SCHEMA]
"""An existing file. Relative paths start from the folder of the YAML they are written in, on the
command line and in Python from the current one; dumped as absolute."""

InputFileOrFolder = Annotated[
    Path, BeforeValidator(partial(_existing, is_folder_allowed=True)), _SCHEMA
]
"""An existing file or folder, likewise."""


PEER_SCHEMES = ("udp", "ws", "rosbridge", "mqtt", "ros2")


def parse_peer_address(text: str) -> SplitResult:
    """Read the address of another program, `scheme://host:port`.

    Raises:
        PydanticCustomError: The scheme is unknown, or the host or the port is missing.

    Example:
        >>> parse_peer_address("mqtt://nas:1883/lab").port
        1883
    """
    try:
        parts = urlsplit(text)
        _ = parts.port
    except ValueError as error:
        wrong = f": {error}."
    else:
        is_known = parts.scheme in PEER_SCHEMES
        is_plain = not {"#", "+", "?"} & set(text.rpartition("@")[2])
        has_host = parts.netloc or parts.scheme == "ros2"  # the router of ros2 is on this machine
        if is_known and has_host and is_plain:
            return parts
        wrong = did_you_mean(parts.scheme, PEER_SCHEMES)
        if is_known:
            wrong = ": it has no host." if is_plain else ": #, + and ? have no meaning in it."
    raise problem(
        f"{text!r} is not the address of a peer{wrong or '.'} Write udp://HOST:PORT, ws://HOST:PORT,"
        " rosbridge://HOST:PORT, mqtt://HOST:PORT/PREFIX or ros2://"
    )


def _checked_peer_address(text: str) -> str:
    parse_peer_address(text)
    return text


PeerAddress = Annotated[str, AfterValidator(_checked_peer_address)]
"""The address of another program of a live run, such as ws://127.0.0.1:8765."""


MAX_DURATION = timedelta(days=365_250)  # 1000 years: microseconds stay far inside int64
# Fractions with more digits could fill the memory.
MAX_DIGITS = 400
MICROSECOND = timedelta(microseconds=1)

# Exponents are short on purpose: Fraction("1e999999999") would fill the memory.
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?"
_PART = re.compile(rf"\s*({_NUMBER})\s*([^\s\d.,+-][^\s\d,]*)?\s*,?")
_TIME_OF_DAY = re.compile(r"(\d{1,2}):([0-5]\d)(?::([0-5]\d(?:\.\d{1,6})?))?")


@dataclass(frozen=True)
class Quantity:
    """A physical quantity, and how it is written.

    Attributes:
        name: Its name, with an article.
        base: Its base unit.
        units: The size of its units in base units, by spelling.
        examples: Values.
        asked: The units that an error about a bare number lists; empty: it is in the base unit.
    """

    name: str
    base: str
    units: Mapping[str, Fraction]
    examples: tuple[str, ...]
    asked: tuple[str, ...] = ()

    def parse(self, value: object) -> Fraction:
        """Return the exact value in base units of a number, a text, or a mapping {unit: number}.

        Raises:
            PydanticCustomError: The value can't be read; the message shows how the quantity is
                written.
        """
        if isinstance(value, str):
            return self._parse_text(value)
        if isinstance(value, Mapping) and value:
            total = Fraction(0)
            for unit, number in value.items():
                total += self._number(number, value) * self._unit(unit, value)
            return total
        return self._without_unit(self._number(value, value), value)

    def _without_unit(self, number: Fraction, value: object) -> Fraction:
        if number and self.asked:
            *first, last = (f"'{str(value).strip()} {unit}'" for unit in self.asked)
            raise problem(f"{one_line(value)} has no unit: write {', '.join(first)} or {last}")
        return number

    def _parse_text(self, text: str) -> Fraction:
        total = Fraction(0)
        position = 0
        while position < len(text) or not position:
            part = _PART.match(text, position)
            if part is None or (not part[2] and part.span() != (0, len(text))):
                raise self._unreadable(text)
            if len(part[1]) > MAX_DIGITS:
                raise problem(f"expected at most {MAX_DIGITS} digits in a row, got {shown(text)}")
            number = Fraction(part[1])
            unit = part[2]
            total += number * self._unit(unit, text) if unit else self._without_unit(number, text)
            position = part.end()
        return total

    def _number(self, value: object, source: object) -> Fraction:
        if isinstance(value, bool) or not isinstance(value, Real | Decimal):
            raise self._unreadable(source)
        try:
            # With repr, 0.1 is one tenth, not the nearest binary fraction.
            exact = value if isinstance(value, Decimal) else Decimal(repr(float(value)))
        except OverflowError:
            exact = Decimal("Infinity")
        if not exact.is_finite() or exact.adjusted() > MAX_DIGITS:
            raise problem(f"expected {self.name}, a finite number, got {shown(value)}")
        return Fraction(exact)

    def _unit(self, unit: object, source: object) -> Fraction:
        factor = self.units.get(str(unit))
        if factor is None:
            raise problem(
                f"unknown unit {str(unit)!r} in {shown(source)}: {self.name} is written "
                f"like {self._examples()}"
            )
        return factor

    def _unreadable(self, value: object) -> PydanticCustomError:
        return problem(f"expected {self.name}, got {shown(value)}: write {self._forms()}")

    def _forms(self) -> str:
        unit = f" in {self.base}" if self.base else ""
        number = "it with a unit," if self.asked else f"a number{unit}, or"
        return f"{number} like {self._examples()}"

    def _examples(self) -> str:
        return ", ".join(f"'{example}'" for example in self.examples)

    def schema(self, *others: dict[str, Any]) -> WithJsonSchema:
        """Return the JSON Schema of the quantity, or `others`; ``x-quantity`` is its short name."""
        _, name = self.name.split(" ", 1)
        number = {"const": 0} if self.asked else {"type": "number"}
        return WithJsonSchema(
            {
                "description": f"{self.name}: {self._forms()}",
                "x-quantity": f"{name} [{self.base}]" if self.base else name,
                "anyOf": [number, {"type": "string"}, *others],
                "examples": list(self.examples),
            }
        )


def _spellings(**units: tuple[Fraction | int, str]) -> dict[str, Fraction]:
    """Return the factor of each spelling from {canonical spelling: (factor, synonyms)}."""
    return {
        spelling: Fraction(factor)
        for canonical, (factor, synonyms) in units.items()
        for spelling in (canonical, *synonyms.split())
    }


DURATION = Quantity(
    "a duration",
    "s",
    _spellings(
        us=(Fraction(1, 10**6), "µs microsecond microseconds"),
        ms=(Fraction(1, 1000), "millisecond milliseconds"),
        s=(1, "sec second seconds"),
        min=(60, "minute minutes"),
        h=(HOUR_S, "hour hours"),
        d=(DAY_S, "day days"),
        w=(604_800, "week weeks"),
    ),
    ("30 s", "5 min", "1 h", "14 d"),
    ("d", "h", "min", "s"),
)
LENGTH = Quantity(
    "a length",
    "m",
    _spellings(
        mm=(Fraction(1, 1000), ""), cm=(Fraction(1, 100), ""), m=(1, "metres meters"), km=(1000, "")
    ),
    ("0.2 m", "20 cm", "5 mm"),
)
SPEED = Quantity(
    "a speed",
    "m/s",
    {"m/s": Fraction(1), "cm/s": Fraction(1, 100), "km/h": Fraction(5, 18)},
    ("0.6 m/s", "3.6 km/h"),
)
_DEG_PER_RAD = Fraction(180 / math.pi)
ANGLE = Quantity(
    "an angle",
    "degrees",
    _spellings(deg=(1, "° degree degrees"), rad=(_DEG_PER_RAD, ""), turn=(360, "turns")),
    ("108 deg", "1.9 rad"),
)
TURN_RATE = Quantity(
    "a turn rate",
    "degrees per second",
    {"deg/s": Fraction(1), "°/s": Fraction(1), "rad/s": _DEG_PER_RAD},
    ("90 deg/s", "1.5 rad/s"),
)
SHARE = Quantity("a share", "", {"%": Fraction(1, 100)}, ("0.95", "95 %"))


def micros(duration: timedelta) -> int:
    """Return a duration in whole microseconds, exactly.

    >>> micros(timedelta(days=30))
    2592000000000
    """
    return duration // MICROSECOND


def whole_steps(
    duration: timedelta, step_us: int, key: str, error: type[Exception] = ScenarioError
) -> int:
    """Return the number of steps in a duration.

    Args:
        duration: A multiple of the step.
        step_us: The length of a step [us].
        key: The key of the duration, for the message.
        error: The type of the exception.

    Raises:
        ScenarioError: The duration isn't a multiple of the step, or is 0; of the type `error`.

    >>> whole_steps(timedelta(minutes=1), 500_000, "period")
    120
    """
    steps, rest = divmod(micros(duration), step_us)
    if rest or steps < 1:
        raise error(
            f"{key} is {format_duration(duration)}, which is not a multiple of simulation.step"
            f" ({step_us / 1e6:g} s): choose a multiple"
        )
    return steps


def parse_duration(value: object) -> timedelta:
    """Read a duration: a timedelta, text with units, {unit: number}, or 0.

    >>> parse_duration("1 h 30 min") == parse_duration({"hours": 1.5}) == timedelta(seconds=5400)
    True

    Raises:
        PydanticCustomError: The value is no duration, has no unit, or is negative, too long, or
            shorter than a microsecond.
    """
    if not isinstance(value, timedelta):
        seconds = DURATION.parse(value)
        count = round(seconds * 10**6)
        if seconds and not count:
            raise problem(f"expected a duration of 1 microsecond or longer, got {shown(value)}")
        if abs(count) > micros(MAX_DURATION):
            raise problem(f"expected a duration of at most 1000 years, got {shown(value)}")
        value = timedelta(microseconds=count)
    if value < timedelta(0):
        raise problem(f"expected a duration of 0 or more, got {format_duration(value)}")
    if value > MAX_DURATION:
        raise problem(f"expected a duration of at most 1000 years, got {format_duration(value)}")
    return value


def format_duration(duration: timedelta) -> str:
    """Write a duration in the largest unit that divides it, as :func:`parse_duration` reads it.

    >>> [format_duration(timedelta(seconds=s)) for s in (2592000, 3600, 90, 0.5, 0)]
    ['30 d', '1 h', '90 s', '0.5 s', '0 s']
    """
    count = micros(duration)
    for unit, seconds in (("d", DAY_S), ("h", HOUR_S), ("min", 60)):
        units, rest = divmod(count, seconds * 10**6)
        if count and not rest:
            return f"{units} {unit}"
    return f"{_plain(Decimal(count).scaleb(-6))} s"


def _plain(number: Decimal) -> str:
    text = f"{number:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def parse_time_of_day(value: object) -> timedelta:
    """Read a time of day as the time since midnight; '24:00' is the end of the day.

    >>> parse_time_of_day("07:30")
    datetime.timedelta(seconds=27000)

    Raises:
        PydanticCustomError: The value is no time of day.
    """
    if isinstance(value, time) and value.tzinfo is None:
        value = value.isoformat()
    if isinstance(value, str) and (match := _TIME_OF_DAY.fullmatch(value.strip())):
        seconds = Fraction(match[3] or 0)
        count = (int(match[1]) * HOUR_S + int(match[2]) * 60 + seconds) * 10**6
        value = timedelta(microseconds=int(count))
    elif not isinstance(value, timedelta):
        raise problem(f"expected a time of day like '07:30' or '22:15:30', got {shown(value)}")
    if not timedelta(0) <= value <= timedelta(days=1):
        raise problem(f"expected a time of day up to 24:00, got {format_time_of_day(value)}")
    return value


def format_time_of_day(value: timedelta) -> str:
    """Write a time since midnight as 'HH:MM', with seconds where there are any.

    >>> format_time_of_day(timedelta(hours=7, minutes=30))
    '07:30'
    """
    minutes, seconds_us = divmod(micros(value), 60 * 10**6)
    clock = f"{minutes // 60:02}:{minutes % 60:02}"
    if not seconds_us:
        return clock
    return f"{clock}:{Decimal(seconds_us).scaleb(-6):09f}".rstrip("0").rstrip(".")


def _to_float(quantity: Quantity) -> BeforeValidator:
    def parse(value: object) -> float:
        try:
            return float(quantity.parse(value))
        except OverflowError:
            raise problem(
                f"expected {quantity.name}, a finite number, got {shown(value)}"
            ) from None

    return BeforeValidator(parse)


def limited_to(is_valid: Callable[[Any], bool], expected: str) -> AfterValidator:
    """Return a validator that refuses invalid values; `expected` says which are valid."""

    def check(value: Any) -> Any:
        if not is_valid(value):
            text = format_duration(value) if isinstance(value, timedelta) else f"{value:g}"
            raise problem(f"expected {expected}, got {text}")
        return value

    return AfterValidator(check)


_PLURALS = [unit for unit in DURATION.units if unit.endswith("s") and len(unit) > 3]

Duration = Annotated[
    timedelta,
    BeforeValidator(parse_duration),
    PlainSerializer(format_duration, return_type=str, when_used="json"),
    DURATION.schema(
        {
            "type": "object",
            "properties": {unit: {"type": "number"} for unit in _PLURALS},
            "additionalProperties": {"type": "number"},
        }
    ),
]
"""A length of time, 0 or more, exact to the microsecond; a timedelta in Python."""

PositiveDuration = Annotated[
    Duration, limited_to(lambda value: value > timedelta(0), "a duration longer than 0")
]
"""A :data:`Duration` above 0."""

Length = Annotated[float, _to_float(LENGTH), LENGTH.schema()]
"""A length or a coordinate [m]."""

PositiveLength = Annotated[Length, limited_to(lambda value: value > 0, "a length above 0")]
"""A :data:`Length` above 0."""

Speed = Annotated[
    float,
    _to_float(SPEED),
    limited_to(lambda value: value >= 0, "a speed of 0 or more"),
    SPEED.schema(),
]
"""A speed, 0 or more [m/s]."""

SignedSpeed = Annotated[float, _to_float(SPEED), SPEED.schema()]
"""A speed along an axis, negative against it [m/s]."""

AngleDeg = Annotated[float, _to_float(ANGLE), ANGLE.schema()]
"""An angle [degrees], counter-clockwise from +x where it is a heading."""

TurnRateDeg = Annotated[
    float,
    _to_float(TURN_RATE),
    limited_to(lambda value: value >= 0, "a turn rate of 0 or more"),
    TURN_RATE.schema(),
]
"""How fast a body turns, 0 or more [degrees/s]."""

SignedTurnRateDeg = Annotated[float, _to_float(TURN_RATE), TURN_RATE.schema()]
"""How fast a body turns counter-clockwise, negative if clockwise [degrees/s]."""

Share = Annotated[
    float,
    _to_float(SHARE),
    limited_to(lambda value: 0 <= value <= 1, "a share from 0 to 1, or from '0 %' to '100 %'"),
    SHARE.schema(),
]
"""A probability or a part of a whole, 0 to 1."""

TimeOfDay = Annotated[
    timedelta,
    BeforeValidator(parse_time_of_day),
    PlainSerializer(format_time_of_day, return_type=str, when_used="json"),
    WithJsonSchema(
        {
            "description": "a time of day, like '07:30' or '22:15:30'; '24:00' ends the day",
            "x-quantity": "time of day",
            "type": "string",
            "pattern": r"^\d{1,2}:[0-5]\d(:[0-5]\d(\.\d{1,6})?)?$",
            "examples": ["07:30", "22:15:30"],
        }
    ),
]
"""A time of day: the time since midnight, 00:00 to 24:00; a timedelta in Python."""


WEEKDAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
GROUPS = {"daily": range(7), "weekdays": range(5), "weekend": range(5, 7)}
Days = Literal[
    "daily", "weekdays", "weekend",
    "monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday",
]  # fmt: skip
"""The name of a day or of a group of days of the week."""
OnDays = Days | Annotated[tuple[Days, ...], Field(min_length=1)]
"""One such name, or a list of them."""


def weekdays_of(names: str | Sequence[str] | None) -> set[int]:
    """Return days of the week by their names, 0 is Monday; None: no day.

    >>> sorted(weekdays_of(["weekend", "friday"])), weekdays_of(None)
    ([4, 5, 6], set())
    """
    if isinstance(names, str):
        names = (names,)
    return {day for name in names or () for day in _days_of(name)}


def _days_of(name: str) -> Sequence[int]:
    if name in GROUPS:
        return GROUPS[name]
    if name in WEEKDAYS:
        return (WEEKDAYS.index(name),)
    raise problem(
        f"unknown day {name!r}; there are: {', '.join((*GROUPS, *WEEKDAYS))}, or a list of those"
        " like 'monday,friday'"
    )
