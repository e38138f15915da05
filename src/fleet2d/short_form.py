"""The short form of users and robots: their only behavior, written beside their body's keys.

::

    users: {ana: {type: room_sampling, radius: 20 cm}}
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pydantic import BaseModel, GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationError
from pydantic_core import CoreSchema, InitErrorDetails, core_schema

from fleet2d.problems import problem_at, rewrite, unknown_key


def split_short_form(data: Any, body_fields: Iterable[str]) -> Any:
    """Move the fields of an entity's only behavior from beside its body's into ``behaviors``.

    >>> split_short_form({"type": "meander", "radius": 0.2, "pause": 3}, ["radius"])
    {'radius': 0.2, 'behaviors': [{'type': 'meander', 'pause': 3}]}
    """
    if isinstance(data, str):
        return {"behaviors": [data]}
    if not isinstance(data, Mapping) or "type" not in data:
        return data
    if "behaviors" in data:
        raise problem_at(("behaviors",), "give 'type' (one behavior) or 'behaviors', not both")
    body = {key: value for key, value in data.items() if key in set(body_fields)}
    return {**body, "behaviors": [{k: v for k, v in data.items() if k not in body}]}


class ShortForm:
    """Lets an entity's only behavior be written beside its body: ``Annotated[User, ShortForm()]``.

    Errors in the behavior's fields name the keys as they are written.
    """

    def __get_pydantic_core_schema__(
        self, source: type[BaseModel], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate ``source`` from both forms."""
        body = source.model_fields.keys() - {"behaviors"}

        def move(line: InitErrorDetails) -> InitErrorDetails:
            if line["loc"][:2] == ("behaviors", 0):
                line["loc"] = line["loc"][2:]
                if "known" in line["ctx"] and len(line["loc"]) == 1:
                    line["type"] = unknown_key(line["loc"][0], {*line["ctx"]["known"], *body})
            return line

        def validate(data: Any, validate_long: Callable[[Any], Any]) -> Any:
            long = split_short_form(data, body)
            try:
                return validate_long(long)
            except ValidationError as error:
                raise error if long is data else rewrite(error, move) from None

        return core_schema.no_info_wrap_validator_function(validate, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return a mark with the body's keys, for `fleet2d.scenario.schema` to add short forms."""
        long = handler(schema)
        body = dict(handler.resolve_ref_schema(long)["properties"])
        kind = body.pop("behaviors")["items"]["x-kind"]
        return {"anyOf": [long], "x-short-form": {"kind": kind, "body": body}}
