"""`fleet2d show`: pictures of floor plans, runs and diaries."""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import typer

from fleet2d.cli.results import print_verdict
from fleet2d.configuration.problems import suggest, validating
from fleet2d.errors import Fleet2DError, InputError, RunDirectoryError, os_errors_as
from fleet2d.options import (
    BODY_RADIUS_M,
    Radius,
    Resolution,
    Scale,
    Trust,
    file_name,
    show_code,
)


def show_diary(name: str | None, out: Path | None, days: int, seed: int) -> list[str]:
    """Return a persona's diary as lines of text, the path of its picture last.

    Args:
        name: The name of a bundled persona, or a YAML file.
        out: The picture to write; None: a file in the working directory, named after the persona.
        days: The number of days, from a Monday on.
        seed: The seed of the days.

    Raises:
        InputError: There is no such persona, or the file is not a persona.
    """
    from pydantic import TypeAdapter

    from fleet2d.routines.persona import AnyPersona, bundled_names
    from fleet2d.viewing.pictures.charts import diary_days, diary_lines, draw_diary

    if name is None:
        raise InputError(
            f"--diary needs a persona: one of {', '.join(bundled_names())}, or a YAML file"
        )
    path = Path(name)
    if name not in bundled_names() and not path.is_file():
        raise InputError(
            f"there is no persona {name!r}{suggest(name, bundled_names())}; your own is the path of"
            " a YAML file"
        )
    with validating(name):
        persona = TypeAdapter(AnyPersona).validate_python(name)
    diary = diary_days(persona, days, seed)
    target = out or Path(f"{path.stem}-diary.png")
    draw_diary(persona, path.stem, diary, target)
    return [*diary_lines(path.stem, persona, diary), str(target)]


Figure = Annotated[
    Literal["life", "heat", "strip"],
    typer.Option(
        help="Of a run: life in the home; heat maps of where people and robots were; a strip of"
        " time, a row for each."
    ),
]


def show(  # noqa: PLR0913 - options of the command line
    source: Annotated[
        Path | None,
        typer.Argument(metavar="FLOORPLAN|RUN_DIR|PERSONA", help="Left out: the bundled home."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Picture to write, .png, .svg or .pdf.")] = None,
    resolution: Resolution = None,
    scale: Scale = None,
    layer: Annotated[
        str | None, typer.Option(help="Of a run: draw this layer, such as explored.astro.")
    ] = None,
    step: Annotated[
        int | None, typer.Option(help="With --layer: as it was after this step; else the last.")
    ] = None,
    diary: Annotated[
        bool, typer.Option("--diary", help="Of a persona: its activities on some days.")
    ] = False,
    days: Annotated[int, typer.Option(min=1, max=60, help="With --diary: how many days.")] = 7,
    seed: Annotated[int, typer.Option(help="With --diary: of the days.")] = 4,
    reliability: Annotated[
        str | None,
        typer.Option(help="Of a run: how often forecasts of presence by this algorithm came true."),
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
    checkup: Annotated[
        bool, typer.Option("--checkup", help="Of a floor plan: mark what `validate` finds.")
    ] = False,
    log: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help="Of a run: the log of a robot as text: decisions, moves, people, battery, faults.",
        ),
    ] = None,
    day: Annotated[
        int | None, typer.Option(help="With --log: only this day; day 1 is the first.")
    ] = None,
    radius: Radius = BODY_RADIUS_M,
    trust: Trust = False,
) -> None:
    """Draw a floor plan, a run or a diary; print a robot's log.

    Examples:
      fleet2d show family_home --out home.svg
      fleet2d show runs/home-001 --at 'day 3 18:30'
      fleet2d show runs/home-001 --log astro --day 3
    """
    picture = RunPicture(layer, step, reliability, at, begin, end, figure)
    if day is not None and log is None:
        raise InputError("--day is the day of a robot's log: give --log ROBOT, too")
    if log is not None:
        _check_alone(picture, checkup=checkup, diary=diary, fov=fov)
        show_log(source, log, day, (begin, end), out, trust=trust)
    elif checkup:
        typer.echo(_draw_checkup(source, out, radius, resolution=resolution, scale=scale))
    elif diary:
        for line in show_diary(None if source is None else str(source), out, days, seed):
            typer.echo(line)
    else:
        typer.echo(
            _draw(source, out, picture, fov, trust=trust, resolution=resolution, scale=scale)
        )


def show_log(
    source: Path | None,
    robot: str,
    day: int | None,
    part: tuple[str | None, str | None],
    out: Path | None,
    *,
    trust: bool,
) -> None:
    """Print the log of a robot, or write it to a file.

    Args:
        source: The directory of a run.
        robot: The robot.
        day: The day of the run; None: all days.
        part: The begin and the end instead of a day, as texts; None: those of the run.
        out: The file to write; None: standard output.
        trust: Whether code of the run may be run.

    Raises:
        InputError: There is no such run, robot or day.
    """
    from fleet2d.engine.repeat import decisions_of
    from fleet2d.runs.moments import steps_of
    from fleet2d.runs.robot_log import day_of, log_lines, robot_log
    from fleet2d.runs.run import open_run

    if source is None:
        raise InputError("--log needs the directory of a run: fleet2d show RUN_DIR --log ROBOT")
    if day is not None and part != (None, None):
        raise InputError("give --day, or --from and --to, not both")
    run = open_run(source, trust=trust)
    first, end = steps_of(run, *part) if day is None else day_of(run, day)
    decisions = None
    if "decisions" not in run.tables:
        try:
            decisions = decisions_of(run)
        except Fleet2DError as error:
            typer.echo(f"the log lacks decisions, as the run can't be repeated: {error}", err=True)
    lines = log_lines(robot_log(run, robot, first, end, decisions), run.clock)
    if out is None:
        for line in lines:
            typer.echo(line)
        return
    with os_errors_as(RunDirectoryError, f"{out} can't be written"):
        out.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    typer.echo(out)


def _check_alone(picture: "RunPicture", **others: object) -> None:
    """Refuse options of pictures beside those of a log.

    Raises:
        InputError: Such an option is given.
    """
    pictures = picture._replace(begin=None, end=None)
    if pictures != RunPicture() or any(others.values()):
        raise InputError("--log prints text: leave out the options of pictures")


class RunPicture(NamedTuple):
    """The options that choose a picture of a run."""

    layer: str | None = None
    step: int | None = None
    reliability: str | None = None
    at: str | None = None
    begin: str | None = None
    end: str | None = None
    figure: Literal["life", "heat", "strip"] = "life"

    def check(self) -> None:
        """Check that the options choose one picture.

        Raises:
            InputError: They choose two.
        """
        stretch = self.begin is not None or self.end is not None or self.figure != "life"
        kinds = [self.layer is not None or self.step is not None, self.reliability is not None]
        if sum([*kinds, self.at is not None, stretch]) > 1:
            raise InputError(
                "one picture at a time: --layer, --reliability, --at, or --from, --to and --figure"
            )


def _draw(
    source: Path | None,
    out: Path | None,
    picture: RunPicture,
    fov: str | None,
    *,
    trust: bool,
    **lengths: float | None,
) -> Path:
    """Draw a run or a floor plan; return the path of the picture."""
    if picture.step is not None and picture.layer is None:
        raise InputError("--step needs --layer: it is the step of the layer to draw")
    is_run = source is not None and (source / "manifest.json").exists()
    if fov is not None if is_run else picture != RunPicture():
        raise InputError(
            "--layer, --step, --reliability, --at, --from, --to and --figure are for a run's"
            " directory, --fov for a floor plan"
        )
    if source is not None and is_run:
        return _draw_run(source, out, picture, trust=trust)
    if source is not None and source.is_dir():
        raise RunDirectoryError(
            f"{source} holds no run: give a run directory or a floor plan's file"
        )
    if source is not None and not source.exists() and source.parent != Path():
        raise RunDirectoryError(
            f"there is no {source}: give the directory of a run (what --out named), a floor plan's"
            " file, synthetic:SEED, or family_home"
        )
    return _draw_floorplan(source, out, fov, **lengths)


def _draw_run(directory: Path, out: Path | None, picture: RunPicture, *, trust: bool) -> Path:
    """Draw a picture of a stored run; return its path."""
    from fleet2d.runs.run import open_run

    picture.check()
    run = open_run(directory, trust=trust)
    if trust:
        show_code(run.manifest)
    print_verdict(run, err=True)  # stdout is for the path
    if picture.layer is not None:
        from fleet2d.viewing.pictures.layers import draw_layer

        target = out or directory / f"{picture.layer}.png"
        draw_layer(run, picture.layer, target, picture.step)
    elif picture.reliability is not None:
        from fleet2d.viewing.pictures.charts import draw_reliability

        target = out or directory / f"{picture.reliability}-reliability.png"
        draw_reliability(run, picture.reliability, target)
    elif picture.at is not None:
        from fleet2d.runs.moments import step_of
        from fleet2d.viewing.figures import draw_moment

        step = step_of(picture.at, run.clock)
        target = out or directory / f"step-{step}.png"
        draw_moment(run, min(step, run.manifest["steps"] - 1), target)
    elif picture == RunPicture():
        from fleet2d.viewing.pictures.run import draw_run

        target = out or directory / "picture.png"
        draw_run(run, target)
    else:
        from fleet2d.runs.moments import steps_of
        from fleet2d.viewing.figures import draw_stretch

        first, end = steps_of(run, picture.begin, picture.end)
        target = out or directory / f"{picture.figure}-{first}-{end}.png"
        draw_stretch(run, first, end, target, picture.figure)
    return target


def _draw_checkup(
    source: Path | None, out: Path | None, radius: float, **lengths: float | None
) -> Path:
    """Draw a floor plan with the findings about it; return the path of the picture."""
    from fleet2d.floorplan.checkup import checkup
    from fleet2d.floorplan.load import load_or_mark
    from fleet2d.viewing.pictures.floorplan import draw_checkup

    plan = load_or_mark(source or "family_home", **lengths)
    target = out or Path(f"{file_name(plan.name) or 'plan'}-checkup.png")
    draw_checkup(plan, checkup(plan, radius), target)
    return target


def _draw_floorplan(
    source: Path | None, out: Path | None, fov: str | None, **lengths: float | None
) -> Path:
    """Draw a floor plan, or a field of view in it; return the path of the picture."""
    from fleet2d.floorplan.load import load_or_mark
    from fleet2d.viewing.pictures.floorplan import draw_floorplan

    plan = load_or_mark(source or "family_home", **lengths)
    target = out or Path(f"{file_name(plan.name) or 'plan'}.png")
    if fov is not None:
        from fleet2d.viewing.pictures.layers import draw_fov, parse_pose

        draw_fov(plan, parse_pose(fov), target)
    else:
        draw_floorplan(plan, target)
    return target
