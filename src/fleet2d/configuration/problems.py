"""Errors that validators raise: a message about a key, with the nearest valid name."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, get_args

from fleet2d.bounds import one_line
from fleet2d.errors import ScenarioError

if TYPE_CHECKING:  # programs that validate nothing needn't load pydantic for a name's hint
    from pydantic import ValidationError
    from pydantic_core import InitErrorDetails, PydanticCustomError

Location = tuple[int | str, ...]

MAX_LINES = 100
"""Lines of an error that are explained; a file may have as many errors as values."""


def problem(message: str, group: str = "") -> "PydanticCustomError":
    """Return the error that a validator raises about its value.

    Args:
        message: The message, shown as it is.
        group: Of several errors with the same group, only the first is shown.
    """
    from pydantic_core import PydanticCustomError

    return PydanticCustomError("problem", "{message}", {"message": message, "group": group})


def problem_at(
    location: Location, message: str, value: object = None, group: str = ""
) -> "ValidationError":
    """Return the error that a validator raises about a key within its value; see `problem`."""
    from pydantic_core import InitErrorDetails, ValidationError

    line = InitErrorDetails(type=problem(message, group), loc=location, input=value)
    return ValidationError.from_exception_data("", [line])


def unknown_key(key: object, known: Iterable[str]) -> "PydanticCustomError":
    """Return the error about a key that is not among the known ones."""
    from pydantic_core import PydanticCustomError

    names = sorted(known)
    return PydanticCustomError(
        "unknown_key",
        "unknown key {key}{hint} Allowed here: {names}",
        {
            "key": one_line(repr(key)),
            "hint": did_you_mean(key, names),
            "names": ", ".join(names) or "none",
            "known": names,
        },
    )


def rewrite(
    error: "ValidationError", change: "Callable[[InitErrorDetails], InitErrorDetails]"
) -> "ValidationError":
    """Return the same error, its first lines only, with ``change`` applied to each of them."""
    from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError, core_schema

    own_kinds = get_args(core_schema.ErrorType)
    lines = []
    for line in error.errors(include_url=False)[:MAX_LINES]:
        kind = line["type"]
        context = line.get("ctx", {})
        details = InitErrorDetails(type=kind, loc=line["loc"], input=line["input"], ctx=context)
        if kind not in own_kinds:
            # The message is inserted last, so that braces within it are no placeholders.
            context = {key: context[key] for key in context if key != "message"}
            context["message"] = line["msg"]
            details["type"] = PydanticCustomError(kind, "{message}", context)
        lines.append(change(details))
    return ValidationError.from_exception_data(error.title, lines)


def refusal(prefix: str, error: "ValidationError") -> ScenarioError:
    """Return the first error of a validation, on one line.

    Args:
        prefix: The beginning of the message, such as the method that was called; may be empty.
        error: The error of the validation.
    """
    first = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in first["loc"])
    reason = first.get("ctx", {}).get("error", first["msg"])
    return ScenarioError(": ".join(filter(None, [prefix, key, str(reason)])))


@contextmanager
def validating(prefix: str) -> Iterator[None]:
    """Raise a ScenarioError, on one line, in place of a validation's errors in the block.

    Args:
        prefix: The beginning of the message, as of `refusal`.
    """
    from pydantic_core import ValidationError

    try:
        yield
    except ValidationError as error:
        raise refusal(prefix, error) from None


def did_you_mean(name: object, known: Iterable[object]) -> str:
    """Return ": did you mean …?" for the nearest of the known names, else a full stop.

    >>> did_you_mean("sped", ["speed", "radius"])
    ": did you mean 'speed'?"
    """
    name = str(name)[:60]
    names = list(map(str, known))
    longer = [other for other in names if name and other.startswith(f"{name}_")]
    import difflib  # only messages need it

    near = longer or difflib.get_close_matches(name, names, n=1)
    return f": did you mean {near[0]!r}?" if near else "."


def suggest(name: object, known: Iterable[object], intro: str = "There are") -> str:
    """Return the end of a message about an unknown name: the nearest known name, and all of them.

    >>> suggest("sped", ["speed", "radius"])
    ": did you mean 'speed'? There are: speed, radius"
    >>> suggest("hall", [], "It has")
    '. It has: none'
    """
    names = [str(k) for k in known]
    return f"{did_you_mean(name, names)} {intro}: {', '.join(names) or 'none'}"


def check_known(
    name: object,
    noun: str,
    known: Iterable[object],
    error: Callable[[str], Exception] = ScenarioError,
    where: str = "",
) -> None:
    """Raise an error if a name is not among the known ones.

    Args:
        name: The name.
        noun: The kind of the named thing, such as "room".
        known: The known names.
        error: The error to raise.
        where: The beginning of its message.

    >>> check_known("hal", "room", ["hall"])
    Traceback (most recent call last):
    fleet2d.errors.ScenarioError: there is no room 'hal': did you mean 'hall'? There are: hall
    """
    names = list(known)
    if name not in names:
        raise error(f"{where}there is no {noun} {name!r}{suggest(name, names)}")


def counted(number: int, noun: str) -> str:
    """Return a number with its noun.

    >>> counted(1, "day"), counted(30, "day")
    ('1 day', '30 days')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def shown(value: object) -> str:
    """Return a value as text for a message: text in quotes, everything else as it is.

    >>> shown("fast"), shown(3)
    ("'fast'", '3')
    """
    if isinstance(value, str):
        return one_line(repr(str(value)))
    # A huge number or a long list is shown by its size alone.
    if isinstance(value, int) and value.bit_length() > 200:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, list | tuple) and len(value) > 20:
        return f"a list of {len(value)}"
    if isinstance(value, Mapping) and len(value) > 20:
        return f"a mapping of {len(value)} keys"
    return one_line(value)
