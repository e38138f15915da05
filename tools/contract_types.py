"""Generate ``contract.ts`` of the page: ``python -m tools.contract_types > contract.ts``."""

import json
import sys
import types
import typing
from typing import Any, Literal

from typing_extensions import is_typeddict

from fleet2d.runtime.events import EventKind
from fleet2d.viewing import contract, look

HEADER = "// Written by `python -m tools.contract_types` from fleet2d.viewing.contract.\n"
_PLAIN = {str: "string", int: "number", float: "number", bool: "boolean", type(None): "null"}


def contract_source() -> str:
    """Return the TypeScript interfaces of all types of the contract."""
    shapes = [value for value in vars(contract).values() if is_typeddict(value)]
    return "\n".join([HEADER, _event_kinds(), *map(_interface, shapes), _look()])


def _look() -> str:
    tables = json.dumps(look.constants(), indent=2)
    comment = "/** How homes are drawn: `fleet2d.viewing.look`. */"
    return f"{comment}\nexport const LOOK = {tables} as const;\n"


def _event_kinds() -> str:
    kinds = _typescript(Literal[*EventKind])
    return f"/** Every kind of event that Fleet2D records. */\nexport type EventKind = {kinds};\n"


def _interface(shape: Any) -> str:
    comment = " ".join((shape.__doc__ or "").split())
    fields = typing.get_type_hints(shape)
    lines = [f"  {name}: {_typescript(kind)};" for name, kind in fields.items()]
    body = "\n".join(lines)
    return f"/** {comment} */\nexport interface {shape.__name__} {{\n{body}\n}}\n"


def _typescript(kind: Any) -> str:
    """Return a type in TypeScript."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return "unknown"
    if kind in _PLAIN:
        return _PLAIN[kind]
    if is_typeddict(kind) or kind is EventKind:
        return str(kind.__name__)
    if origin is Literal:
        return " | ".join(f'"{word}"' for word in arguments)
    if origin in (types.UnionType, typing.Union):
        return " | ".join(map(_typescript, arguments))
    if origin is list:
        item = _typescript(arguments[0])
        return f"({item})[]" if "|" in item else f"{item}[]"
    if origin is tuple:
        return f"[{', '.join(map(_typescript, arguments))}]"
    if origin is dict:
        return f"Record<{_typescript(arguments[0])}, {_typescript(arguments[1])}>"
    raise TypeError(f"{kind} has no TypeScript type: add it to the generator")


if __name__ == "__main__":
    sys.stdout.write(contract_source())
