"""Short forms of fields in the JSON Schema of a configuration."""

from typing import Any, Literal

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

FORMS: dict[str, dict[str, Any]] = {
    "text": {"type": "string"},
    "number": {"type": "number"},
    "pair": {"type": "array", "minItems": 2, "maxItems": 2},
    "extension": {"type": "object", "description": "a mapping that extends another"},
}


class SchemaForms:
    """Lists the short forms of a field: ``Annotated[Period, SchemaForms("pair")]``."""

    def __init__(self, *forms: Literal["text", "number", "pair", "extension"]) -> None:
        self.forms = forms

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Add the forms to the schema."""
        return {"anyOf": [handler(schema), *(FORMS[form] for form in self.forms)]}
