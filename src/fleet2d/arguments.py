"""Arguments of several commands."""

import re
from typing import Annotated, Literal

import typer

Resolution = Annotated[
    float | None,
    typer.Option(help="Metres per pixel, for a floor plan that is a picture without a scale."),
]

ThemeChoice = Annotated[
    Literal["light", "dark"], typer.Option(help="Theme of pictures: a light or a dark background.")
]


def split(arguments: list[str] | None) -> tuple[str | None, list[str]]:
    """Return the scenario, None if there is none, and the overrides, which have a '='."""
    if arguments and "=" not in arguments[0]:
        return arguments[0], arguments[1:]
    return None, list(arguments or [])


def file_name(name: str) -> str:
    """Return a name without the characters that a file name should not have."""
    return re.sub(r"[^\w.-]+", "-", name).strip(".-")
