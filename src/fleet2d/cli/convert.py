"""`fleet2d convert`: turn a floor plan into Fleet2D's format, or an old configuration."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from fleet2d.cli.__main__ import entries
from fleet2d.errors import InputError
from fleet2d.options import Resolution


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            help="A floor plan of any format, or a configuration of the published Fleet2D."
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(help="The floor plan (.json, .yaml, .geojson) or the scenario to write."),
    ],
    resolution: Resolution = None,
) -> None:
    """Turn a floor plan into Fleet2D's own format, or a published configuration into a scenario."""
    from fleet2d.floorplan.load import is_floorplan, load_floorplan

    if is_floorplan(source):
        from fleet2d.floorplan.load import save_floorplan

        plan = load_floorplan(source, resolution=resolution)
        save_floorplan(plan, target)
        notes = list(plan.notes)
    else:
        notes = _converter()(source, target)
    for note in notes:
        typer.echo(f"note: {note}")
    typer.echo(target)


def _converter() -> Callable[[Path, Path], list[str]]:
    """Return the function that converts a configuration of another program into a scenario.

    Raises:
        InputError: There is none.
    """
    for entry in entries("fleet2d.converter"):
        with suppress(ModuleNotFoundError):
            return entry.load()
    raise InputError(
        "this is neither a floor plan (docs/floorplans.md lists the formats) nor a file that an"
        " installed converter takes"
    )
