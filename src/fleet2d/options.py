"""Options and arguments that several commands share."""

import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from fleet2d.configuration.trust import code_lines, content_of_run

Resolution = Annotated[
    float | None,
    typer.Option(help="Metres per pixel, for a floor plan that is a picture without a scale."),
]

Scale = Annotated[
    float | None,
    typer.Option(
        min=1e-6,
        max=1000,
        help="What lengths of a floor plan are multiplied by, such as 0.001 for millimetres.",
    ),
]

BODY_RADIUS_M = 0.15
Radius = Annotated[
    float, typer.Option(min=0.01, max=5, help="Radius of the robot for a floor plan [m].")
]


def resume_hint(time: datetime, directory: Path) -> str:
    """Return a line about a run that was interrupted at a local time."""
    return (
        f"interrupted at {time:%Y-%m-%d %H:%M}; what was simulated until then is in {directory}:"
        f" continue it by `fleet2d resume {directory}`"
    )


def split(arguments: list[str] | None) -> tuple[str | None, list[str]]:
    """Return the scenario, or None, and the overrides, which contain a '='."""
    if arguments and "=" not in arguments[0]:
        return arguments[0], arguments[1:]
    return None, list(arguments or [])


def file_name(name: str) -> str:
    """Return a name without the characters that a file name should not have."""
    return re.sub(r"[^\w.-]+", "-", name).strip(".-")


Workers = Annotated[
    int | None, typer.Option(min=1, help="Processes at a time; left out: one per core.")
]
Trust = Annotated[
    bool,
    typer.Option("--trust", help="Run its own code and programs, which are listed."),
]


def show_code(manifest: Mapping[str, Any]) -> None:
    """Print the code and programs that a trusted stored run names in its manifest."""
    if lines := code_lines(content_of_run(manifest)):
        typer.echo("\n".join(["trusted, with all files in these folders:", *lines]), err=True)
