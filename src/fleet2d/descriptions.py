"""Descriptions of the fields of a model, from the docstrings of its class and base classes."""

import inspect
import re
from typing import Any

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler
from pydantic_core import CoreSchema

_SECTION = re.compile(r"^(?:Attributes|Examples?|Raises):$", re.MULTILINE)
_ENTRY = re.compile(r"^    (\w[\w, ]*): (.*(?:\n {5,}.*)*)", re.MULTILINE)


def descriptions(cls: type) -> dict[str, str]:
    """Return what the section `Attributes` of a class says, and those of its bases, by name.

    >>> class Lamp:
    ...     '''A lamp.
    ...
    ...     Attributes:
    ...         power, most: Its power [W],
    ...             and the most that it can have.
    ...     '''
    >>> descriptions(Lamp)["most"]
    'Its power [W], and the most that it can have.'
    """
    texts: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if base is BaseModel:
            continue
        _, _, section = inspect.cleandoc(vars(base).get("__doc__") or "").partition("Attributes:\n")
        for names, text in _ENTRY.findall(section.partition("\n\n")[0]):
            texts |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return texts


def summary(cls: type) -> str:
    """Return the docstring of a class up to its first section."""
    return _SECTION.split(inspect.cleandoc(cls.__doc__ or ""))[0].rstrip()


class DescribedModel(BaseModel):
    """A model whose JSON Schema takes the descriptions of its fields from docstrings.

    A `description` of a field itself counts more.
    """

    # To build the first validator loads modules that a home without scenario doesn't need.
    model_config = ConfigDict(defer_build=True)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the schema with descriptions."""
        result = handler(schema)
        definition = handler.resolve_ref_schema(result)
        definition["description"] = summary(cls)
        properties, texts = definition.get("properties", {}), descriptions(cls)
        for name, field in cls.model_fields.items():
            key = field.alias or name
            if key in properties and name in texts and not field.description:
                properties[key]["description"] = texts[name]
        return result
