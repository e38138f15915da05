"""Files of floor plans: how they are read, their fields, and errors that name the place in them."""

import json
import math
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    TypeAdapter,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import ErrorDetails

from fleet2d.bounds import FILE_BYTES, JSON_VALUES, Bound, one_line, read_bytes, unique_keys
from fleet2d.configuration.components import DescribedModel
from fleet2d.configuration.problems import Location, problem, suggest
from fleet2d.errors import Fleet2DError, FloorPlanError, InputError, errors_as
from fleet2d.floorplan.foreign import foreign_file

YAML = (".yaml", ".yml")
# No home is as large: a coordinate beyond this is not in metres.
MAX_COORDINATE_M = 100_000.0
TINY = 1e-12

T = TypeVar("T")
Listed = Annotated[list[T], Field(fail_fast=True)]
"""A list of which only the first wrong item is an error, however long it is."""


def in_file(path: Path) -> AbstractContextManager[None]:
    """Put the path of a file before the errors that are raised in the block."""
    return errors_as(FloorPlanError, str(path), FloorPlanError)


@contextmanager
def reading(path: Path, form: str) -> Iterator[None]:
    """Refuse a file for which a library fails in the block.

    Args:
        path: The file.
        form: Its format.
    """
    try:
        yield
    except (Fleet2DError, MemoryError, RecursionError):
        raise
    except Exception as error:
        reason = one_line(error, 200) or type(error).__name__
        raise FloorPlanError(f"{path} is damaged, or not {form}: {reason}") from error


def read_file(path: Path, bound: Bound = FILE_BYTES) -> bytes:
    """Return the content of a file of a bounded size.

    Raises:
        FloorPlanError: There is no such file, it can't be read, or it is too large.
    """
    if path.is_dir():
        raise FloorPlanError(f"{path} is a folder: name the floor plan's file in it")
    try:
        return read_bytes(path, bound, FloorPlanError)
    except FileNotFoundError:
        raise FloorPlanError(f"there is no file {path}: check floorplan.path") from None
    except OSError as error:
        raise FloorPlanError(f"{path} can't be read: {error.strerror or error}") from None


def read_document(path: Path) -> dict[str, Any]:
    """Return the mapping in a YAML file (.yaml, .yml), else the object in a JSON file.

    Raises:
        FloorPlanError: There is no such file, or it holds neither.
    """
    return parse_document(read_file(path), path)


def parse_document(content: bytes, path: Path, *, unique: bool = False) -> dict[str, Any]:
    """Return the mapping in the content of a file, as `read_document` does.

    In JSON, a key that is there twice is refused if keys have to be `unique`; in YAML it always is.
    """
    is_yaml = path.suffix.lower() in YAML
    return parse_yaml(content, path) if is_yaml else parse_json(content, path, unique=unique)


def read_json(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file.

    Raises:
        FloorPlanError: There is no such file, or it doesn't hold a JSON object.
    """
    return parse_json(read_file(path), path)


def parse_json(content: bytes, path: Path, *, unique: bool = False) -> dict[str, Any]:
    """Return the JSON object in the content of a file.

    Args:
        content: The content.
        path: The file, for messages.
        unique: Whether to refuse a key that an object has twice, as in files written by hand.

    Raises:
        FloorPlanError: It doesn't hold a JSON object, or has a key twice.
    """
    text = _text_of(content, path, "JSON")
    values = text.count(",") + text.count("[") + text.count("{")
    JSON_VALUES.check(values, path, FloorPlanError, prefix="about ")
    try:
        document = json.loads(text, object_pairs_hook=unique_keys if unique else None)
    except json.JSONDecodeError as error:
        _refuse_foreign(path, text[:4096].encode())
        raise FloorPlanError(
            f"{path} is not JSON: {error.msg} in line {error.lineno}, column {error.colno}"
        ) from None
    except (RecursionError, ValueError) as error:  # the latter of too long a number
        is_deep = isinstance(error, RecursionError)
        reason = "it has lists in lists without end" if is_deep else error
        raise FloorPlanError(f"{path} is not a floor plan: {reason}") from None
    return _mapping(document, path, "a JSON object {…}")


def read_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping in a YAML file.

    Raises:
        FloorPlanError: There is no such file, or it doesn't hold a YAML mapping.
    """
    return parse_yaml(read_file(path), path)


def parse_yaml(content: bytes, path: Path) -> dict[str, Any]:
    """Return the mapping in the content of a YAML file.

    Raises:
        FloorPlanError: It doesn't hold a YAML mapping.
    """
    # A home in a JSON file is set up without them.
    import yaml

    from fleet2d.configuration.documents import NodeError, parse

    text = _text_of(content, path, "YAML")
    try:
        document = parse(text)
    except (yaml.YAMLError, RecursionError) as error:
        _refuse_foreign(path, text[:4096].encode())
        raise FloorPlanError(f"{path} is not YAML: {one_line(error, 200)}") from None
    except NodeError as error:
        line = error.node.start_mark.line + 1
        raise FloorPlanError(f"{path}, line {line}: {error}") from None
    except InputError as error:
        raise FloorPlanError(f"{path}: {error}") from None
    if isinstance(document, str):
        _refuse_foreign(path, text[:4096].encode())
    return _mapping(document, path, "a YAML mapping of keys and values")


def _text_of(content: bytes, path: Path, language: str) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        _refuse_foreign(path, content[:65536])
        if b"\0" not in content or content.startswith((BOM_UTF16_BE, BOM_UTF16_LE)):
            line = content[: error.start].count(b"\n") + 1
            raise FloorPlanError(
                f"{path}, line {line}: byte {content[error.start]:#04x} is not UTF-8: save the file"
                " with the encoding UTF-8"
            ) from None
        raise FloorPlanError(
            f"{path} is not a {language} text file: check floorplan.path"
        ) from None


def _refuse_foreign(path: Path, content: bytes) -> None:
    """Raise FloorPlanError if a file is one of another program, with what to convert it to."""
    said = foreign_file(content)
    if said is not None:
        raise FloorPlanError(f"{path} {said}") from None


def _mapping(content: object, path: Path, expected: str) -> dict[str, Any]:
    if isinstance(content, dict):
        return content
    kinds = {list: "a list", str: "a text", type(None): "nothing"}
    kind = kinds.get(type(content), "a single value")
    raise FloorPlanError(f"{path} holds {kind}: a floor plan is {expected}")


class FileModel(DescribedModel):
    """An object in a file; a missing or an unknown key is an error that names the known ones."""

    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, content: object) -> object:
        fields = cls.model_fields
        if not isinstance(content, dict):
            raise problem(f"is not an object with the keys {', '.join(fields)}")
        for key in content:
            if key not in fields:
                raise problem(f"has an unknown key {key!r}{suggest(key, fields, 'Known')}")
        return content


# --- Errors ------------------------------------------------------------------------------------

_EXPECTED = {
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
    "greater_than_equal": "{ge} or more",
    "less_than_equal": "{le} or less",
}


def validate(kind: TypeAdapter[T], content: object, where: str = "") -> T:
    """Return content of a file as a type.

    Args:
        kind: The type.
        content: The content.
        where: Its place in the file, for messages; empty for all of the file.

    Raises:
        FloorPlanError: The content is not of that type; names the first wrong place.

    Example:
        >>> validate(TypeAdapter(Listed[Point]), [[0, 1], [2, "x"]], "path")
        Traceback (most recent call last):
        fleet2d.errors.FloorPlanError: path[1] is [2, "x"]: "x" is not a number
    """
    try:
        return kind.validate_python(content)
    except ValidationError as error:
        line = error.errors(include_url=False)[0]
        location = line["loc"][:-1] if line["type"] == "missing" else line["loc"]
        place = where + _place(location, content)
        raise FloorPlanError(f"{place.lstrip('.') or 'the plan'} {_sentence(line)}") from None


def _place(location: Location, content: Any) -> str:
    """Return a location as it is written in code, without keys that aren't in the file."""
    place = ""
    for key in location:
        if isinstance(key, int):
            place += f"[{key}]"
        elif isinstance(content, dict):
            place += f".{key}"
        else:
            continue  # the corners of an area stand there without a key
        content = content[key]
    return place


def _sentence(error: ErrorDetails) -> str:
    """Return what is wrong with a value, as the rest of a sentence that begins with its place."""
    if error["type"] == "problem":
        return error["msg"]
    if error["type"] == "missing":
        return f"has no key {error['loc'][-1]!r}"
    context = error.get("ctx", {})
    expected = _EXPECTED.get(error["type"], "").format(**context)
    if error["type"] == "literal_error":
        expected = "one of " + ", ".join(re.findall(r"'([^']*)'", context["expected"]))
    reason = f"{expected} is expected" if expected else error["msg"]
    return f"is {shown_value(error['input'])}: {reason}"


def shown_value(value: object) -> str:
    """Return a value of a file for a message: as JSON, cut if it is long.

    >>> shown_value([True, None, "x" * 100])
    '[true, null, "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...'
    """
    text = _json_head(value, 3)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _json_head(value: object, depth: int) -> str:
    """Return the beginning of a value as JSON, quickly however large or deep the value is."""
    if isinstance(value, list | dict) and value and depth == 0:
        return "[…]" if isinstance(value, list) else "{…}"
    if isinstance(value, list):
        return f"[{', '.join(_json_head(item, depth - 1) for item in value[:30])}]"
    if isinstance(value, dict):
        first = list(value.items())[:30]
        pairs = (f"{_json_head(key, 0)}: {_json_head(item, depth - 1)}" for key, item in first)
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, int) and abs(value) >= 10**60:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, str):
        value = value[:100]
    return json.dumps(value, default=str)


# --- Values ------------------------------------------------------------------------------------


def list_of(items: str) -> BeforeValidator:
    """Return a validator that refuses what is not a list, and says what it is a list of."""

    def check(value: object) -> object:
        if not isinstance(value, list):
            raise problem(f"is {shown_value(value)}: a list of {items} is expected")
        return value

    return BeforeValidator(check)


def _text(value: object) -> str:
    if not isinstance(value, str) or not value:
        raise problem(f"is {shown_value(value)}: a text is expected")
    return value


def _numbers(value: object, count: int) -> tuple[float, ...]:
    """Return `count` coordinates [m]."""
    if not isinstance(value, list) or len(value) != count:
        raise problem(f"is {shown_value(value)}: a list of {count} numbers [m] is expected")
    for number in value:
        if isinstance(number, bool) or not isinstance(number, int | float):
            reason = f"{shown_value(number)} is not a number"
        elif isinstance(number, float) and not math.isfinite(number):
            reason = "coordinates must be finite numbers"
        elif abs(number) > MAX_COORDINATE_M:
            reason = "too far out for coordinates in metres"
        else:
            continue
        raise problem(f"is {shown_value(value)}: {reason}")
    return tuple(clean_coordinate(number) for number in value)


def _point(value: object) -> tuple[float, ...]:
    """Return a place [m]; the plan of a home has thousands."""
    if type(value) is list and len(value) == 2:
        x, y = value
        is_plain = type(x) is float and type(y) is float
        if is_plain and TINY <= abs(x) <= MAX_COORDINATE_M and TINY <= abs(y) <= MAX_COORDINATE_M:
            return x, y
    return _numbers(value, 2)


def clean_coordinate(number: float) -> float:
    """Return a coordinate as a float, with tiny ones set to 0, since GEOS divides by them."""
    return 0.0 if abs(number) < TINY else float(number)


def _corners(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of an outline without repetitions, also of the first at the end."""
    if len(set(points)) < 3:
        raise problem(f"has {len(set(points))} different points: an outline has at least 3")
    corners = [point for k, point in enumerate(points) if k == 0 or point != points[k - 1]]
    return corners[:-1] if corners[0] == corners[-1] else corners


Text = Annotated[str, PlainValidator(_text), WithJsonSchema({"type": "string", "minLength": 1})]
Coordinate = Annotated[
    float, PlainValidator(lambda value: _numbers([value], 1)[0]), WithJsonSchema({"type": "number"})
]
"""A length [m] or an angle [rad]."""

_POINT = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
Point = Annotated[tuple[float, float], PlainValidator(_point), WithJsonSchema(_POINT)]
"""A place (x, y) [m]."""
BoxSides = Annotated[tuple[float, float, float, float], PlainValidator(lambda v: _numbers(v, 4))]
"""The sides of a box (x0, y0, x1, y1) [m]."""
RING_SCHEMA = {"type": "array", "items": _POINT, "minItems": 3}
Ring = Annotated[
    Listed[Point], list_of("points [x, y]"), AfterValidator(_corners), WithJsonSchema(RING_SCHEMA)
]
"""The corners of an outline [m]."""
