"""Arguments that several commands take."""

import re
from typing import Annotated, Literal

import typer

Resolution = Annotated[
    float | None,
    typer.Option(help="Metres per pixel, of a floor plan that is a mere picture."),
]

ThemeChoice = Annotated[
    Literal["light", "dark"], typer.Option(help="Of pictures: a light or a dark ground.")
]


def split(arguments: list[str] | None) -> tuple[str | None, list[str]]:
    """Tell the scenario from the overrides: it comes first, and has no '='."""
    rest = list(arguments or [])
    if rest and "=" not in rest[0]:
        return rest[0], rest[1:]
    return None, rest


def file_name(name: str) -> str:
    """Return what of a name can be a file's, wherever it comes from."""
    return re.sub(r"[^\w.-]+", "-", name).strip(".-")
