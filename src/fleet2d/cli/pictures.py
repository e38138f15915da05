"""The command that draws: `fleet2d show`."""

from pathlib import Path
from typing import Annotated

import typer

from fleet2d.cli.arguments import Resolution, file_name
from fleet2d.errors import InputError, RunDirectoryError


def show(
    what: Annotated[
        Path | None,
        typer.Argument(metavar="[FLOORPLAN|RUN_DIR|PERSONA]", help="Left out: the bundled home."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Picture to write, .png or .svg.")] = None,
    resolution: Resolution = None,
    layer: Annotated[
        str | None, typer.Option(help="Of a run: draw this layer, such as explored.astro.")
    ] = None,
    step: Annotated[
        int | None, typer.Option(help="With --layer: as it was after this step; else the last.")
    ] = None,
    diary: Annotated[
        bool, typer.Option("--diary", help="Of a persona: what it does on some days.")
    ] = False,
    days: Annotated[int, typer.Option(min=1, max=60, help="With --diary: how many days.")] = 7,
    seed: Annotated[int, typer.Option(help="With --diary: of the days.")] = 4,
    reliability: Annotated[
        str | None,
        typer.Option(help="Of a run: how often what this algorithm believed of presence was true."),
    ] = None,
    fov: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,HEADING[,RANGE,ANGLE]",
            help="Of a floor plan: draw what is in view of a pose [m, degrees].",
        ),
    ] = None,
) -> None:
    """Draw a floor plan of any format, a stored run in its home, or a persona's diary."""
    if diary:
        from fleet2d.cli.diaries import show_diary

        for line in show_diary(None if what is None else str(what), out, days, seed):
            typer.echo(line)
        return
    if step is not None and layer is None:
        raise InputError("--step goes with --layer: it says as of which step a layer is drawn")
    is_run = what is not None and (what / "manifest.json").exists()
    of_run = any(option is not None for option in (layer, step, reliability))
    if fov is not None if is_run else of_run:
        raise InputError(
            "--layer, --step and --reliability are for a run's directory, --fov for a floor plan"
        )
    if reliability is not None and (layer is not None or step is not None):
        raise InputError("one picture at a time: --layer or --reliability")
    if what is not None and is_run:
        target = _draw_run(what, out, layer, step, reliability)
    elif what is not None and what.is_dir():
        raise RunDirectoryError(f"{what} holds no run: give a run directory or a floor plan's file")
    elif what is not None and not what.exists() and what.parent != Path():
        raise RunDirectoryError(
            f"there is no {what}: give the directory of a run (what --out named), a floor plan's"
            " file, synthetic:SEED, or family_home"
        )
    else:
        target = _draw_floorplan(what, out, fov, resolution)
    typer.echo(target)


def _draw_run(
    run: Path, out: Path | None, layer: str | None, step: int | None, reliability: str | None
) -> Path:
    """Draw a stored run in its home, one of its layers, or a reliability diagram; return where."""
    from fleet2d.artifacts.reader import open_run

    if layer is not None:
        from fleet2d.view.layers import draw_layer

        target = out or run / f"{layer}.png"
        draw_layer(open_run(run), layer, target, step)
    elif reliability is not None:
        from fleet2d.view.reliability import draw_reliability

        target = out or run / f"{reliability}-reliability.png"
        draw_reliability(open_run(run), reliability, target)
    else:
        from fleet2d.view.run import draw_run

        target = out or run / "picture.png"
        draw_run(open_run(run), target)
    return target


def _draw_floorplan(
    what: Path | None, out: Path | None, fov: str | None, resolution: float | None
) -> Path:
    """Draw a floor plan, or what a camera sees in it; return where."""
    from fleet2d.floorplan.load import load_floorplan
    from fleet2d.view.floorplan import draw_floorplan

    plan = load_floorplan(what, resolution=resolution) if what else load_floorplan()
    target = out or Path(f"{file_name(plan.name) or 'plan'}.png")
    if fov is not None:
        from fleet2d.view.fov import draw_fov, parse_pose

        draw_fov(plan, parse_pose(fov), target)
    else:
        draw_floorplan(plan, target)
    return target
