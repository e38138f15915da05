"""`fleet2d validate`: check a scenario or a floor plan, without running it."""

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any

import typer

from fleet2d.errors import InputError
from fleet2d.options import Resolution, file_name, split


def validate(
    arguments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENARIO.yaml|FLOORPLAN] [KEY.PATH=VALUE]...",
            help="A scenario and changes to it, or a floor plan of any format.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Picture of a floor plan's check-up, .png or .svg.")
    ] = None,
    radius: Annotated[
        float, typer.Option(min=0.01, max=5, help="Radius of the robot for a floor plan [m].")
    ] = 0.15,
    resolution: Resolution = None,
) -> None:
    """Check a scenario, with the places of all people and robots; or a floor plan."""
    from fleet2d.floorplan.load import is_floorplan

    scenario, overrides = split(arguments)
    if scenario is not None and is_floorplan(scenario):
        if overrides:
            raise InputError(
                f"{scenario} is a floor plan, and {overrides[0]} changes a scenario: leave it out,"
                " or name a scenario"
            )
        _check_floorplan(scenario, out, radius, resolution)
        return
    from fleet2d.engine.simulation import Simulation

    simulation = Simulation(scenario, *overrides)
    plan, settings = simulation.home.plan, simulation.scenario.simulation
    typer.echo(
        f"ok: {_count(simulation.scenario.users, 'user')} and"
        f" {_count(simulation.scenario.robots, 'robot')} in {plan.name}"
        f" ({plan.area_m2:.1f} m2, {len(plan.rooms)} rooms),"
        f" {settings.steps} steps of {settings.step_us / 1e6:g} s from {settings.start}"
    )
    for note in simulation.notes:
        typer.echo(f"note: {note}")
    for actor in simulation.actors.values():
        for note in actor.notes:
            typer.echo(f"note: {actor.path}.{note}")
        for behavior in actor.behaviors:
            for note in getattr(behavior, "notes", ()):
                typer.echo(f"note: {actor.path}: {note}")


def _check_floorplan(
    source: str, out: Path | None, radius: float, resolution: float | None
) -> None:
    """Print the findings of a floor plan and draw them; exit with 2 if it is unlivable.

    Without matplotlib there is no picture, which is an error only if one is asked for.
    """
    from fleet2d.floorplan.checkup import checkup
    from fleet2d.floorplan.load import load_floorplan

    plan = load_floorplan(source, resolution=resolution)
    findings = checkup(plan, radius)
    picture = str(out or Path(f"{file_name(plan.name) or 'plan'}-checkup.png"))
    try:
        from fleet2d.pictures.floorplan import draw_checkup
    except InputError as error:
        if out is not None:
            raise
        picture = f"no picture: {error}"
    else:
        draw_checkup(plan, findings, Path(picture))
    typer.echo(f"{plan.name}: {plan.area_m2:.1f} m2, {_count(plan.rooms, 'room')}")
    for number, finding in enumerate(findings, start=1):
        typer.echo(f"{number:>3} {finding.severity}: {finding.text}")
    if not findings:
        odd = "; the notes tell what is odd in the file" if plan.notes else " or odd was found"
        typer.echo(f"ok: nothing wrong{odd}")
    for note in plan.notes:
        typer.echo(f"note: {note}")
    typer.echo(picture)
    if any(finding.severity == "unlivable" for finding in findings):
        raise typer.Exit(2)


def _count(items: Collection[Any], noun: str) -> str:
    return f"{len(items)} {noun}{'' if len(items) == 1 else 's'}"
