"""The command that draws: `fleet2d show`."""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import typer

from fleet2d.arguments import Resolution, ThemeChoice, file_name
from fleet2d.errors import InputError, RunDirectoryError
from fleet2d.trust_options import TrustFiles, TrustFolders, restrict_to

Figure = Annotated[
    Literal["life", "heat", "strip"],
    typer.Option(
        help="Of a run: life in the home; heat maps of where people and robots were; a strip of"
        " time, a row for each."
    ),
]


def show(  # noqa: PLR0913 - options of the command line
    what: Annotated[
        Path | None,
        typer.Argument(metavar="[FLOORPLAN|RUN_DIR|PERSONA]", help="Left out: the bundled home."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Picture to write, .png, .svg or .pdf.")] = None,
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
    at: Annotated[
        str | None, typer.Option(help="Of a run: a moment, such as 'day 3 18:30'.")
    ] = None,
    begin: Annotated[
        str | None, typer.Option("--from", help="Of a run: where a stretch begins.")
    ] = None,
    end: Annotated[str | None, typer.Option("--to", help="Of a run: where it ends.")] = None,
    figure: Figure = "life",
    theme: ThemeChoice = "light",
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
) -> None:
    """Draw a floor plan of any format, a stored run in its home, or a persona's diary."""
    from fleet2d.view.theme import themed

    wanted = RunPicture(layer, step, reliability, at, begin, end, figure)
    with themed(theme), restrict_to(trust, trust_dir):
        if diary:
            from fleet2d.cli.diaries import show_diary

            for line in show_diary(None if what is None else str(what), out, days, seed):
                typer.echo(line)
        else:
            typer.echo(_draw(what, out, wanted, fov, resolution))


class RunPicture(NamedTuple):
    """Which picture of a run is wanted."""

    layer: str | None = None
    step: int | None = None
    reliability: str | None = None
    at: str | None = None
    begin: str | None = None
    end: str | None = None
    figure: Literal["life", "heat", "strip"] = "life"

    def check(self) -> None:
        """Refuse two pictures at a time.

        Raises:
            InputError: Two are asked for.
        """
        stretch = self.begin is not None or self.end is not None or self.figure != "life"
        kinds = [self.layer is not None or self.step is not None, self.reliability is not None]
        if sum([*kinds, self.at is not None, stretch]) > 1:
            raise InputError(
                "one picture at a time: --layer, --reliability, --at, or --from, --to and --figure"
            )


def _draw(
    what: Path | None,
    out: Path | None,
    wanted: RunPicture,
    fov: str | None,
    resolution: float | None,
) -> Path:
    """Draw a run or a floor plan; return where."""
    if wanted.step is not None and wanted.layer is None:
        raise InputError("--step goes with --layer: it says as of which step a layer is drawn")
    is_run = what is not None and (what / "manifest.json").exists()
    if fov is not None if is_run else wanted != RunPicture():
        raise InputError(
            "--layer, --step, --reliability, --at, --from, --to and --figure are for a run's"
            " directory, --fov for a floor plan"
        )
    if what is not None and is_run:
        return _draw_run(what, out, wanted)
    if what is not None and what.is_dir():
        raise RunDirectoryError(f"{what} holds no run: give a run directory or a floor plan's file")
    if what is not None and not what.exists() and what.parent != Path():
        raise RunDirectoryError(
            f"there is no {what}: give the directory of a run (what --out named), a floor plan's"
            " file, synthetic:SEED, or family_home"
        )
    return _draw_floorplan(what, out, fov, resolution)


def _draw_run(directory: Path, out: Path | None, wanted: RunPicture) -> Path:
    """Draw a stored run in its home, one of its layers, or a reliability diagram; return where."""
    from fleet2d.runs.run import open_run

    wanted.check()
    run = open_run(directory)
    if wanted.layer is not None:
        from fleet2d.view.layers import draw_layer

        target = out or directory / f"{wanted.layer}.png"
        draw_layer(run, wanted.layer, target, wanted.step)
    elif wanted.reliability is not None:
        from fleet2d.view.reliability import draw_reliability

        target = out or directory / f"{wanted.reliability}-reliability.png"
        draw_reliability(run, wanted.reliability, target)
    elif wanted.at is not None:
        from fleet2d.viewer.moments import clock_of, step_of
        from fleet2d.viewer.pictures import draw_moment

        step = step_of(wanted.at, clock_of(run))
        target = out or directory / f"step-{step}.png"
        draw_moment(run, min(step, run.manifest["steps"] - 1), target)
    elif wanted == RunPicture():
        from fleet2d.view.run import draw_run

        target = out or directory / "picture.png"
        draw_run(run, target)
    else:
        from fleet2d.viewer.moments import steps_of
        from fleet2d.viewer.pictures import draw_stretch

        first, end = steps_of(run, wanted.begin, wanted.end)
        target = out or directory / f"{wanted.figure}-{first}-{end}.png"
        draw_stretch(run, first, end, target, wanted.figure)
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
