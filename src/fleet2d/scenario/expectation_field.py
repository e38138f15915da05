"""The type of the keys of a scenario that hold an expectation.

What reads expectations is imported when a scenario has one.
"""

from typing import Annotated, Any

from pydantic import BeforeValidator, GetJsonSchemaHandler, PlainSerializer
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema


def _read(value: Any) -> Any:
    from fleet2d.expectations.parse import read_expectation

    return read_expectation(value)


class _Described:
    """Gives the field the schema of expectations."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        from fleet2d.expectations.parse import JSON_SCHEMA

        return dict(JSON_SCHEMA)


ExpectationField = Annotated[
    Any,
    BeforeValidator(_read),
    PlainSerializer(str, return_type=str, when_used="json"),
    _Described(),
]
"""Text or a mapping in a file, an `Expectation` in Python."""
