"""Commands on scenarios and plans: `fleet2d validate` and `components`."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fleet2d.configuration.problems import counted
from fleet2d.errors import InputError
from fleet2d.options import BODY_RADIUS_M, Radius, Resolution, Scale, split

if TYPE_CHECKING:
    from fleet2d.floorplan.plan import FloorPlan


def validate(
    arguments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SCENARIO.yaml|FLOORPLAN|KEY.PATH=VALUE",
            help="A scenario and changes to it, or a floor plan of any format.",
        ),
    ] = None,
    radius: Radius = BODY_RADIUS_M,
    resolution: Resolution = None,
    scale: Scale = None,
) -> None:
    """Check a scenario or a floor plan without simulating.

    The exit code is 2 if something is wrong.

    Examples:
      fleet2d validate home.yaml
      fleet2d validate bundled:paper robots.astro.speed=0.5
      fleet2d validate synthetic:7 --radius 0.2
    """
    from fleet2d.floorplan.load import is_floorplan, load_or_mark

    scenario, overrides = split(arguments)
    if scenario is not None and is_floorplan(scenario):
        if overrides:
            raise InputError(
                f"{scenario} is a floor plan, and {overrides[0]} changes a scenario: leave it out,"
                " or name a scenario"
            )
        plan = load_or_mark(scenario, resolution=resolution, scale=scale)
        _check_floorplan(plan, radius)
        return
    from fleet2d.engine.simulation import Simulation, flaws_of

    simulation = Simulation(scenario, *overrides)
    plan = simulation.home.plan
    settings = simulation.scenario.simulation
    verdict = "wrong" if flaws_of(simulation) else "ok"
    typer.echo(
        f"{verdict}: {counted(len(simulation.scenario.users), 'user')} and"
        f" {counted(len(simulation.scenario.robots), 'robot')} in {plan.name}"
        f" ({plan.area_m2:.1f} m2, {len(plan.rooms)} rooms),"
        f" {settings.steps} steps of {settings.step_us / 1e6:g} s from {settings.clock.start}"
    )
    for note in simulation.notes:
        typer.echo(note if note.startswith("wrong: ") else f"note: {note}")
    for actor in simulation.actors.values():
        for behavior in actor.behaviors:
            for note in getattr(behavior, "notes", ()):
                typer.echo(f"note: {actor.path}: {note}")
    if flaws_of(simulation):
        raise typer.Exit(2)


def _check_floorplan(plan: "FloorPlan", radius: float) -> None:
    """Print the findings of a floor plan; exit with 2 if something is wrong."""
    from fleet2d.floorplan.checkup import checkup

    findings = checkup(plan, radius)
    typer.echo(f"{plan.name}: {plan.area_m2:.1f} m2, {counted(len(plan.rooms), 'room')}")
    for number, finding in enumerate(findings, start=1):
        typer.echo(f"{number:>3} {finding.severity}: {finding.text}")
    if not findings:
        odd = "; the notes tell what is odd in the file" if plan.notes else " or odd was found"
        typer.echo(f"ok: nothing wrong{odd}")
    for note in plan.notes:
        typer.echo(f"note: {note}")
    if any(finding.severity != "odd" for finding in findings):
        raise typer.Exit(2)


def components(
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON list.")] = False,
    schema: Annotated[
        Literal["scenario", "floorplan"] | None,
        typer.Option(
            help="Print the JSON Schema of a scenario, or of a floor plan in our own format, for an"
            " editor."
        ),
    ] = None,
) -> None:
    """List all types with their keys, units and defaults.

    Examples:
      fleet2d components
      fleet2d components --schema scenario
    """
    if schema is not None:
        _print_schema(schema)
        return
    from fleet2d.scenario.schema import describe_components

    descriptions = describe_components()
    if as_json:
        typer.echo(json.dumps([asdict(component) for component in descriptions], indent=2))
        return
    for component in descriptions:
        typer.echo(f"{component.kind}: {component.type}\n    {component.summary}")
        for field in component.fields:
            default = "required" if field.default is None else f"= {field.default or repr('')}"
            typer.echo(f"    {field.name}: {field.type} {default}")
            if field.description:
                typer.echo(f"        {field.description}")
        if component.shares:
            typer.echo(f"    and the keys of {', '.join(component.shares)}")
        typer.echo("")


def _print_schema(of: Literal["scenario", "floorplan"]) -> None:
    if of == "floorplan":
        from fleet2d.floorplan.native import native_schema as content
    else:
        from fleet2d.scenario.schema import schema as content
    typer.echo(json.dumps(content(), indent=2))
