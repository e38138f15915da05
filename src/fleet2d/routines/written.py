"""Other ways to write a group of keys than as a mapping, for the JSON Schema."""

from dataclasses import dataclass
from typing import Any, Literal

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

FORMS: dict[str, dict[str, Any]] = {
    "text": {"type": "string"},
    "number": {"type": "number"},
    "pair": {"type": "array", "minItems": 2, "maxItems": 2},
    "extension": {"type": "object", "description": "a mapping that extends another"},
}


@dataclass(frozen=True, init=False)
class OrWritten:
    """Says that a field takes other forms, too: ``Annotated[Takes, OrWritten("text", "pair")]``."""

    forms: tuple[str, ...]

    def __init__(self, *forms: Literal["text", "number", "pair", "extension"]) -> None:
        object.__setattr__(self, "forms", forms)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Add the forms."""
        return {"anyOf": [handler(schema), *(FORMS[form] for form in self.forms)]}
