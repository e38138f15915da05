"""The JSON Schema of Fleet2D's own floor plan format, for editors and other programs."""

from typing import Any, get_args

from fleet2d.floorplan.formats.native import FORMAT, VERSION
from fleet2d.floorplan.objects import Blocks, Posture


def native_schema() -> dict[str, Any]:
    """Return the JSON Schema of a floor plan file.

    It says what the file may hold. That outlines don't cross, doors stand in passages and names
    differ is checked when the plan is read.

    >>> sorted(native_schema()["required"])
    ['format', 'free', 'version']
    """
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Fleet2D floor plan",
        "description": "A home. Lengths are in metres, angles in radians counter-clockwise from +x",
        **_object(
            ("format", "version", "free"),
            format={"const": FORMAT},
            version={"const": VERSION},
            name=_text("what the plan is called; left out: as its file"),
            free=_list("part", "the parts of the free space between the walls", least=1),
            rooms=_list("room", "what its rooms are; space of none is the room unknown_0"),
            doorways=_list("doorway", "passages between rooms; left out: they are looked for"),
            objects=_list("object", "furniture and devices; they are no walls"),
            no_go=_list("shape", "areas that robots keep out of"),
            entrance={**_to("point"), "description": "a place just inside the front door"},
        ),
        "$defs": _definitions(),
    }


def _definitions() -> dict[str, Any]:
    number = {"type": "number"}
    label = {"type": "string"}
    room = _object(
        ("type",),
        name=_text("its own name; left out: its type and a number"),
        type=_text("what it is used for, such as bedroom"),
        labels={"type": "array", "items": label, "description": "every type that it has"},
        polygon=_to("shape"),
        region=_list("part", "where it is, if that is in several parts"),
    )
    return {
        "point": {"type": "array", "items": number, "minItems": 2, "maxItems": 2},
        "ring": _list("point", "corners, the first not repeated at the end", least=3),
        "part": _object(("outline",), outline=_to("ring"), holes=_list("ring", "what it lacks")),
        "shape": {"anyOf": [_to("ring"), _to("part")]},
        "room": {**room, "oneOf": [{"required": ["polygon"]}, {"required": ["region"]}]},
        "doorway": _object(
            ("start", "end"),
            name=_text("its own name; left out: the two rooms that it joins"),
            start=_to("point"),
            end=_to("point"),
            leaf={"type": "boolean", "default": True, "description": "whether a door hangs in it"},
        ),
        "object": _object(
            ("type", "footprint"),
            name=_text("its own name; left out: its type and a number"),
            type=_text("what it is, such as bed"),
            footprint=_to("shape"),
            blocks={
                "enum": list(get_args(Blocks)),
                "default": "path",
                "description": "what can't pass: nothing, bodies, or bodies and sight",
            },
            heading={**number, "default": 0, "description": "where its front faces"},
            uses=_list("use", "places to use it from"),
        ),
        "use": _object(
            ("x", "y", "heading"),
            x=number,
            y=number,
            heading={**number, "description": "where the person faces"},
            posture={"enum": list(get_args(Posture)), "default": "stand"},
            approach={**_to("point"), "description": "where one walks to before"},
        ),
    }


def _object(required: tuple[str, ...], **properties: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": list(required),
        "additionalProperties": False,
    }


def _to(name: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{name}"}


def _list(name: str, description: str, least: int = 0) -> dict[str, Any]:
    smallest = {"minItems": least} if least else {}
    return {"type": "array", "description": description, "items": _to(name), **smallest}


def _text(description: str) -> dict[str, Any]:
    return {"type": "string", "minLength": 1, "description": description}
