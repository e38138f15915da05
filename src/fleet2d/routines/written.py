"""Other ways to write a group of keys than as a mapping, for the JSON Schema."""

from dataclasses import dataclass
from typing import Any

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

TEXT = {"type": "string"}
NUMBER = {"type": "number"}
PAIR = {"type": "array", "minItems": 2, "maxItems": 2}


@dataclass(frozen=True)
class OrWritten:
    """Says that a field takes other forms, too: ``Annotated[Takes, OrWritten(TEXT, PAIR)]``."""

    forms: tuple[dict[str, Any], ...]

    def __init__(self, *forms: dict[str, Any]) -> None:
        object.__setattr__(self, "forms", forms)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Add the forms."""
        return {"anyOf": [handler(schema), *self.forms]}
