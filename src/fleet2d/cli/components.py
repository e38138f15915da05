"""`fleet2d components`: list all types that a scenario may name."""

import json
from dataclasses import asdict
from typing import Annotated

import typer


def components(
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON list.")] = False,
) -> None:
    """List every registered type, with its fields, units and defaults."""
    from fleet2d.scenario.schema import describe_components

    descriptions = describe_components()
    if as_json:
        typer.echo(json.dumps([asdict(component) for component in descriptions], indent=2))
        return
    for component in descriptions:
        names = " or ".join((component.type, *component.aliases))
        typer.echo(f"{component.kind}: {names}\n    {component.summary}")
        for field in component.fields:
            default = "required" if field.default is None else f"= {field.default or repr('')}"
            typer.echo(f"    {field.name}: {field.type} {default}")
            if field.description:
                typer.echo(f"        {field.description}")
        typer.echo("")
