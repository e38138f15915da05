"""The metaclass of components: clear errors about the declaration of their fields."""

import json
import re
from collections.abc import Mapping
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, PydanticUserError

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


class ComponentClass(ModelMetaclass):
    """The metaclass of components, which explains errors in the declaration of fields."""

    def __new__(
        cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **kwargs: Any
    ) -> type:
        """Create the class.

        Raises:
            TypeError: a field is declared in a way that can't be configuration.
        """
        # A user's class is built at once, so that the error stands where the class is declared.
        kwargs.setdefault("defer_build", namespace["__module__"].startswith("fleet2d."))
        try:
            return super().__new__(cls, name, bases, namespace, **kwargs)
        except PydanticUserError as error:
            raise TypeError(_wrong_field(name, namespace, error)) from None


def _wrong_field(name: str, namespace: Mapping[str, Any], error: PydanticUserError) -> str:
    untyped = ("model-field-missing-annotation", "model-field-overridden")
    attribute = re.search(r"`(\w+) = |Field '(\w+)'", error.message)
    if error.code not in untyped or attribute is None:
        reason = re.sub(r"<class '(?:\w+\.)*(\w+)'>", r"\1", error.message)
        return f"{name} has a field that can't be configuration: {reason.partition('. ')[0]}"
    key = attribute[1] or attribute[2]
    value = namespace.get(key)
    kind = "str | None" if value is None else type(value).__name__
    literal = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
    if len(literal) > 40 or isinstance(value, PurePath):
        literal = "…"
    return (
        f"{name}.{key} has no type: write `{key}: {kind} = {literal}` for configuration, "
        f"`{key}: ClassVar[{kind}] = {literal}` for a constant"
    )
