"""`fleet2d schema`: print the JSON Schema of scenarios or of floor plans."""

import json
from typing import Annotated

import typer


def schema(
    floorplan: Annotated[
        bool, typer.Option("--floorplan", help="The schema of Fleet2D's own floor plan format.")
    ] = False,
) -> None:
    """Print the JSON Schema of a scenario, for completion in an editor."""
    if floorplan:
        from fleet2d.floorplan.formats.native import native_schema

        typer.echo(json.dumps(native_schema(), indent=2))
        return
    from fleet2d.scenario.schema import schema as scenario_schema

    typer.echo(json.dumps(scenario_schema(), indent=2))
