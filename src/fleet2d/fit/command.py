"""The command `fleet2d fit`: what it prints and writes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from fleet2d.fit.validate import Validation

fitting = typer.Typer(help="Learn from a real log.", no_args_is_help=True)

# A callback, as typer would otherwise drop the name of the only subcommand.
fitting.callback()(lambda: None)


@fitting.command()
def routine(
    log: Annotated[Path, typer.Argument(help="A log of rooms and activities, or its folder.")],
    out: Annotated[Path, typer.Option(help="The persona to write.")] = Path("persona.yaml"),
    layout: Annotated[
        str, typer.Option("--format", help="Its layout, see docs/replay.md; auto recognizes it.")
    ] = "auto",
    picture: Annotated[
        Path | None, typer.Option(help="Picture of the fit to write, .png or .svg.")
    ] = None,
    seed: Annotated[int, typer.Option(help="The seed of the sampled days.")] = 0,
    model: Annotated[
        str, typer.Option(help="recorded: days that switch between those of the log; laws.")
    ] = "recorded",
    sort: Annotated[bool, typer.Option(help="Sort lines whose time runs backwards.")] = False,
) -> None:
    """Learn a persona from a log, and report how well its days match days held back."""
    for line in fit_routine(log, out, layout, picture, seed, sort=sort, model=model):
        typer.echo(line)


def fit_routine(
    path: Path,
    out: Path,
    layout: str = "auto",
    picture: Path | None = None,
    seed: int = 0,
    *,
    sort: bool = False,
    model: str = "recorded",
) -> list[str]:
    """Fit a persona to a log, write it, and return a report in lines.

    Args:
        path: The log.
        out: The file of the persona.
        layout: The log's layout; "auto" recognizes it.
        picture: The file of a picture that compares it with the log; None: no picture.
        seed: The seed of the days that are sampled to compare.
        sort: Sort lines of the log whose time runs backwards.
        model: "recorded" or "laws", see `fit_persona`.

    Raises:
        LogError: The log can't be read, is of positions, or has too few days.
    """
    from fleet2d.fit.days import find_days
    from fleet2d.fit.persona import fit_persona, to_yaml
    from fleet2d.fit.timeline import read_timeline
    from fleet2d.fit.validate import validate
    from fleet2d.logs.layouts import layout_names
    from fleet2d.logs.log import ActivityLog, LogError
    from fleet2d.logs.read import read_log

    layouts = ["auto", *layout_names()]
    if layout not in layouts:
        raise LogError(f"--format: expected one of {', '.join(layouts)}, got {layout!r}")
    if model not in ("recorded", "laws"):
        raise LogError(f"--model: expected recorded or laws, got {model!r}")
    log = read_log(path, layout, sort=sort)
    if not isinstance(log, ActivityLog):
        raise LogError(f"{path} is a log of positions: a persona is fitted to a log of rooms")
    timeline = read_timeline(log)
    days = find_days(timeline)
    validation = validate(timeline, seed=seed, model=model)  # type: ignore[arg-type]
    about = f"fitted to {len(days)} days of {log.path.name}"
    fitted = fit_persona(timeline, days, about, model=model)  # type: ignore[arg-type]
    try:
        out.write_text(to_yaml(fitted.document), encoding="utf-8")
    except OSError as error:
        raise LogError(f"{out} can't be written: {error.strerror}") from error
    lines = [f"note: {note}" for note in (*log.notes, *fitted.notes)]
    lines += table(validation)
    if picture is not None:
        from fleet2d.fit.picture import draw_fit

        draw_fit(timeline, days, fitted, picture, seed)
        lines.append(str(picture))
    return [*lines, str(out)]


def table(validation: "Validation") -> list[str]:
    """Return the distances of a validation as lines of text."""
    from fleet2d.fit.validate import MODELS

    lines = [
        f"{validation.days} days in {validation.folds} parts, each held back in turn: distances of"
        " days sampled from models of the other parts",
        f"{'':30}{'time shares':>12}{'by hour':>10}{'stays KS':>10}{'stays [min]':>12}",
    ]
    for title, distances in (("rooms", validation.rooms), ("activities", validation.activities)):
        lines.append(title)
        lines += [
            f"  {name:28}{d.share:12.3f}{d.hours:10.3f}{d.ks:10.3f}{d.stay_min:12.1f}"
            for name, d in zip(MODELS, distances, strict=True)
        ]
    worse = validation.worse_than_copying()
    verdict = "; ".join(worse) or "in no distance of rooms"
    lines.append(f"the persona is worse than copies of whole days: {verdict}")
    return lines
