"""Read a floor plan by its name, a file, a bundled home or a synthetic one, and write it to a file.

A synthetic home is named by its seed, such as `synthetic:7`. Foreign formats and synthetic homes
are components of a limb, imported when they are needed.
"""

import json
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

from fleet2d.configuration.components import components, lookup
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import named_path
from fleet2d.errors import FloorPlanError, InputError, UnclearPlaceError
from fleet2d.floorplan.files import YAML, read_document, read_yaml
from fleet2d.floorplan.foreign import foreign_document, foreign_file
from fleet2d.floorplan.native import (
    FORMAT,
    bundled_names,
    native_document,
    read_bundled,
)
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.inputs import open_input

DEFAULT_CELL_M = 0.05
IMAGES = (".pgm", ".png", ".jpg", ".jpeg")
JSON = (".json", ".geojson")
SYNTHETIC = re.compile(r"synthetic:(0|[1-9][0-9]{0,17})", re.ASCII)


def load_floorplan(
    plan: str | Path = "family_home",
    cell: float | None = None,
    *,
    resolution: float | None = None,
    scale: float | None = None,
) -> FloorPlan:
    """Read a floor plan.

    Args:
        plan: A file, whose content determines its format; or the name of a bundled home; or
            `synthetic:` and the seed of a synthetic one.
        cell: Side of a grid cell [m]; None for 0.05, or for the side of the pixels of a map.
        resolution: Side of a pixel [m] of a picture without a YAML file.
        scale: What lengths are multiplied by, such as 0.001 for millimetres; None for 1, or what
            the file says.

    Raises:
        FloorPlanError: There is no such plan, or it can't be read.

    Example:
        >>> load_floorplan().name
        'family_home'
    """
    names = bundled_names()
    path = Path(plan)
    usual = DEFAULT_CELL_M if cell is None else cell
    if path.suffix.lower() in IMAGES and path.is_file():
        return source_of("image", path=path, resolution=resolution, cell=cell, scale=scale).load()
    if resolution is not None:
        raise FloorPlanError(
            f"{plan} is not a picture: leave out --resolution, because the file contains lengths"
        )
    if str(plan) in names:
        return read_bundled(str(plan), usual, scale)
    seed = SYNTHETIC.fullmatch(str(plan))
    if seed is not None:
        return source_of("synthetic", seed=int(seed[1]), cell=usual, scale=scale).load()
    if not path.exists() and path.suffix == "" and path.name == str(plan):
        raise FloorPlanError(
            f"there is no floor plan file {str(plan)!r}, and no bundled home of that name"
            f"{suggest(plan, names, 'Bundled homes')}; synthetic ones:"
            " synthetic:0, synthetic:1, …"
        )
    return source_of(format_of_file(path), path=path, cell=cell, scale=scale).load()


def load_or_mark(plan: str | Path, **lengths: float | None) -> FloorPlan:
    """Read a floor plan; where a drawing is unclear, mark the place in a copy of it.

    Args:
        plan: As of `load_floorplan`.
        lengths: Its `resolution` and `scale`.

    Raises:
        FloorPlanError: As of `load_floorplan`; it names the copy, `NAME-question.png`.
    """
    try:
        return load_floorplan(plan, **lengths)
    except FloorPlanError as error:
        if not isinstance(error.__cause__, UnclearPlaceError):
            raise
        out = Path(f"{Path(plan).stem}-question.png")
        _mark(error.__cause__, Path(plan), out)
        raise FloorPlanError(f"{error}; {out} marks it") from error


def _mark(unclear: UnclearPlaceError, drawing: Path, out: Path) -> None:
    """Write a copy of a drawing with a red circle round a place; needs Pillow."""
    from PIL import Image, ImageDraw

    with Image.open(drawing) as image:
        copy = image.convert("RGB")
    column, row = unclear.place
    radius = max(unclear.radius, max(copy.size) / 30)
    box = (column - radius, row - radius, column + radius, row + radius)
    ImageDraw.Draw(copy).ellipse(box, outline="red", width=max(max(copy.size) // 200, 2))
    copy.save(out)


def source_of(kind: str, **settings: Any) -> FloorPlanSource:
    """Return a source by its type and settings; those that are None have their defaults.

    Raises:
        FloorPlanError: It needs another setting.
        ScenarioError: There is no such type.
    """
    return source_type(kind).of_file(**settings)


def source_type(kind: str) -> type[FloorPlanSource]:
    """Return the class of a source by its `type` in a scenario.

    Raises:
        ScenarioError: There is no such type.
    """
    cls = lookup("floorplan", kind)
    assert issubclass(cls, FloorPlanSource)
    return cls


def is_floorplan(plan: str | Path) -> bool:
    """Return whether a name or file denotes a floor plan, readable or not, and not a scenario.

    >>> [is_floorplan(name) for name in ("family_home", "synthetic:7", "plan.json", "run.yaml")]
    [True, True, True, False]
    """
    path = Path(plan)
    if path.suffix.lower() not in YAML:
        is_home = str(plan) in bundled_names() or SYNTHETIC.fullmatch(str(plan)) is not None
        is_known = path.suffix.lower() in (*JSON, *IMAGES) or format_by_suffix(path) is not None
        return is_home or is_known or _is_foreign(path)
    try:
        content = read_yaml(path)
    except FloorPlanError:
        return False
    return _format_of(content) is not None or "image" in content


def _is_foreign(path: Path) -> bool:
    """Return whether a file is one of another program, which may have had a plan in it."""
    try:
        with open_input(path) as file:
            return foreign_file(file.read(65536)) is not None
    except (OSError, InputError):
        return False


def format_of_file(path: Path) -> str:
    """Return the `type` of a floor plan in a scenario that reads a file.

    Raises:
        FloorPlanError: It can't be read, or isn't a floor plan that Fleet2D knows.
    """
    if (kind := format_by_suffix(path)) is not None:
        return kind
    content = read_document(path)
    kind = _format_of(content)
    if kind is None and path.suffix.lower() in YAML and "image" in content:
        kind = "ros"
    if kind is None:
        raise _unknown_format(path, content)
    return kind


def advise_type(name: str) -> str:
    """Return how to read a file that is named as the `type` of a floor plan; "" if it isn't a file.

    A relative path starts from the folder of the scenario.

    >>> advise_type("sketch.png")
    'to read a file write {type: image, path: sketch.png}'
    """
    path = named_path(name)
    if path.suffix.lower() not in (*plan_suffixes(), *IMAGES):
        return ""
    kinds = _types_by_suffix(path)
    if path.is_file() and len(kinds) > 1:
        try:
            kinds = [format_of_file(path)]
        except FloorPlanError as error:
            return str(error)
    if len(kinds) == 1:
        return f"to read a file write {{type: {kinds[0]}, path: {name}}}"
    return f"to read a file write {{type: TYPE, path: {name}}} with one of {', '.join(kinds)}"


def _types_by_suffix(path: Path) -> list[str]:
    """Return the `type` of each floor plan that reads files with such an ending."""
    if path.suffix.lower() in IMAGES:
        return ["image"]
    kind = format_by_suffix(path)
    if kind is not None:
        return [kind]
    kinds = {kind for kind, _ in _marks()}
    return sorted(kinds | {"ros"} if path.suffix.lower() in YAML else kinds)


def _unknown_format(path: Path, content: dict[str, Any]) -> FloorPlanError:
    said = foreign_document(content)
    if said is not None:
        return FloorPlanError(f"{path} {said}")
    marks = [f"{_as_json(*mark)} ({kind})" for kind, mark in sorted(_marks(), key=lambda m: m[0])]
    endings = [f", and doesn't end in {e} ({kind})" for e, kind in sorted(_suffixes().items())]
    return FloorPlanError(
        f"{path} is not a floor plan that Fleet2D can read: it has none of {', '.join(marks)}"
        f"{''.join(endings)}"
    )


def _as_json(key: str, value: str | None) -> str:
    return f'"{key}"' if value is None else f'"{key}": "{value}"'


def _format_of(content: dict[str, Any]) -> str | None:
    """Return the `type` of the floor plan in a file, by the marks that formats declare."""
    if content.get("format") == FORMAT:  # the usual format, without importing the others
        return "native"
    for kind, (key, value) in _marks():
        found = _at(content, key)
        if found is not _NOTHING and value in (None, found):
            return kind
    return None


_NOTHING = object()


def _at(content: Any, key: str) -> Any:
    """Return what is in a file at a key, or `_NOTHING`; `a.0.b` is below other keys."""
    for step in key.split("."):
        if isinstance(content, dict):
            content = content.get(step, _NOTHING)
        elif isinstance(content, list) and step.isdigit() and int(step) < len(content):
            content = content[int(step)]
        else:
            return _NOTHING
    return content


def format_by_suffix(path: Path) -> str | None:
    """Return the `type` of floor plan that reads files with such an ending, if any declares it."""
    suffix = path.suffix.lower()
    return None if suffix in ("", *JSON, *YAML) else _suffixes().get(suffix)


def plan_suffixes() -> tuple[str, ...]:
    """Return the endings of files that may be floor plans, pictures left out."""
    return (*JSON, *YAML, *sorted(_suffixes()))


def _suffixes() -> dict[str, str]:
    """Return the `type` of floor plan for each ending that a format declares."""
    sources = components("floorplan").items()
    return {suffix: kind for kind, src in sources for suffix in getattr(src, "suffixes", ())}


def _marks() -> list[tuple[str, tuple[str, str | None]]]:
    """Return the marks of the formats that have some, each with their `type`."""
    sources = components("floorplan").items()
    return [(kind, mark) for kind, source in sources for mark in getattr(source, "marks", ())]


_NUMBER = r"[-+.\deE]+"
_POINT = re.compile(rf"\[\s+({_NUMBER}),\s+({_NUMBER})\s+\]")


def save_floorplan(plan: FloorPlan, path: str | Path) -> None:
    """Write a plan to a new file, in the format of its suffix.

    `.json`, `.yaml` and `.yml` are Fleet2D's own format; reading it at the same cell size gives an
    equal plan. `.geojson` is for other programs.

    Raises:
        FloorPlanError: The file exists, can't be written, or has another suffix.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".geojson":
        text = _json(source_type("geojson").document(plan))
    elif suffix == ".json":
        text = _json(native_document(plan))
    elif suffix in YAML:
        text = _yaml(native_document(plan), path)
    else:
        raise FloorPlanError(f"{path}: a floor plan is written as .json, .yaml or .geojson")
    write_new(path, text.encode())


def _json(document: dict[str, Any]) -> str:
    """Return JSON with one point to a line."""
    return _POINT.sub(r"[\1, \2]", json.dumps(document, indent=1)) + "\n"


def _yaml(document: dict[str, Any], path: Path) -> str:
    """Return YAML with one point to a line."""
    import yaml  # a home in a JSON file is read without it

    dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    style: dict[str, Any] = {"default_flow_style": None, "sort_keys": False, "width": 100}
    try:
        text: str = yaml.dump(document, Dumper=dumper, **style)
    except UnicodeEncodeError as error:
        raise FloorPlanError(f"{path} can't be written: {error}; choose .json") from error
    return text


def write_new(path: Path, content: bytes) -> None:
    """Write a new file.

    Raises:
        FloorPlanError: It exists, or can't be written.
    """
    from fleet2d.storage.files import write_atomically  # few homes are written

    try:
        path.touch(exist_ok=False)  # at once, so that no file that appears meanwhile is replaced
        try:
            write_atomically(path, content)
        except BaseException:
            with suppress(OSError):
                path.unlink()
            raise
    except FileExistsError:
        raise FloorPlanError(f"{path} exists already: remove it, or name another file") from None
    except OSError as error:
        raise FloorPlanError(f"{path} can't be written: {error.strerror or error}") from error
