"""The commands `fleet2d fit persona` and `perception`, whose functions Python code calls, too.

They return what the commands print, in lines.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from fleet2d.learning.fit.perception import Calibration, FittedProbability
    from fleet2d.learning.fit.persona import FittedPersona
    from fleet2d.learning.fit.validation import Validation


def _print(lines: list[str], **_: Any) -> None:
    for line in lines:
        typer.echo(line)


fitting = typer.Typer(
    help="Fit a persona or a camera to a real log.\n\nExamples:\n"
    "  fleet2d fit persona events.txt --out persona.yaml\n"
    "  fleet2d fit perception detections.csv --out perception.yaml",
    no_args_is_help=True,
    result_callback=_print,
)
UNITS = {"distance": " m", "bearing": " deg"}


@fitting.command(
    "persona",
    help="Learn a persona from a log.\n\n"
    "A report says how well its days match days held back.\n\nExamples:\n"
    "  fleet2d fit persona events.txt --out persona.yaml --picture fit.png",
)
def fit_routine(  # noqa: PLR0913 - each is an option
    path: Annotated[
        Path, typer.Argument(metavar="LOG", help="A log of rooms and activities, or its folder.")
    ],
    out: Annotated[Path, typer.Option(help="The persona to write.")] = Path("persona.yaml"),
    layout: Annotated[
        str,
        typer.Option("--format", help="Its layout (docs/how-to/replay.md); auto recognizes it."),
    ] = "auto",
    picture: Annotated[
        Path | None, typer.Option(help="Picture of the fit to write, .png or .svg.")
    ] = None,
    seed: Annotated[int, typer.Option(help="The seed of the sampled days.")] = 0,
    *,
    sort: Annotated[bool, typer.Option(help="Sort lines whose time runs backwards.")] = False,
    rooms: Annotated[
        list[str] | None,
        typer.Option(metavar="LABEL=KIND", help="The kind of room of a label. Several."),
    ] = None,
    gap: Annotated[str, typer.Option(help="A longer silence is unknown.")] = "3 h",
    still: Annotated[str, typer.Option(help="Silence in a room up to this is not.")] = "12 h",
    id: Annotated[  # noqa: A002 - as the key of `replay`
        str | None, typer.Option(help="The person, of a log with several.")
    ] = None,
    time_zone: Annotated[str | None, typer.Option(help="The time zone of the home.")] = None,
    private: Annotated[
        bool,
        typer.Option("--private", "--share", help="A persona for others: no day of the log in it."),
    ] = False,
) -> list[str]:
    """Fit a persona to a log, write it, and return a report in lines.

    Args:
        path: The log.
        out: The file of the persona.
        layout: The log's layout; "auto" recognizes it.
        picture: The file of a picture that compares it with the log; None: no picture.
        seed: The seed of the days that are sampled for the comparison.
        sort: Sort lines of the log whose time runs backwards.
        rooms: The kinds of rooms of some labels, like `M003=bedroom`; `M003=` leaves a label out.
        gap: Silence longer than this is unknown.
        still: Silence in one room up to this long counts as a stay.
        id: The person, of a log with several.
        time_zone: The time zone of the home, if times have an offset.
        private: Draw new days that are like those of the log, so that the persona can be shared.

    Raises:
        LogError: The log can't be read, is of positions, or has too few days.
    """
    from pydantic_core import PydanticCustomError

    from fleet2d.configuration.units import parse_duration
    from fleet2d.errors import errors_as, os_errors_as
    from fleet2d.learning.fit.persona import fit_persona, gaps, to_yaml
    from fleet2d.learning.fit.timeline import find_days, read_timeline
    from fleet2d.learning.fit.validation import validate
    from fleet2d.logs.layout import LAYOUTS, read_log
    from fleet2d.logs.log import ActivityLog, LogError

    layouts = ["auto", *LAYOUTS]
    if layout not in layouts:
        raise LogError(f"--format: expected one of {', '.join(layouts)}, got {layout!r}")
    log = read_log(path, layout, sort=sort, id=id, time_zone=time_zone)
    if not isinstance(log, ActivityLog):
        raise LogError(f"{path} is a log of positions: a persona is fitted to a log of rooms")
    chosen = dict(_pair(text) for text in rooms or ())
    with errors_as(LogError, of=PydanticCustomError):
        timeline = read_timeline(log, chosen, parse_duration(gap), parse_duration(still))
    days = find_days(timeline)
    validation = validate(timeline, seed=seed, private=private)
    about = (
        "like the days of a log" if private else f"fitted to {len(days)} days of {log.path.name}"
    )
    fitted = fit_persona(timeline, days, about, private=private)
    with os_errors_as(LogError, f"{out} can't be written"):
        out.write_text(to_yaml(fitted.document), encoding="utf-8")
    lines = [f"note: {note}" for note in (*log.notes, *fitted.notes, *gaps(timeline, days))]
    lines += table(validation)
    lines += privacy(fitted, private)
    if picture is not None:
        from fleet2d.learning.fit.picture import draw_persona

        draw_persona(timeline, days, fitted, picture, seed)
        lines.append(str(picture))
    return [*lines, str(out)]


def _pair(text: str) -> tuple[str, str]:
    """Return a label and the kind of its room.

    Raises:
        LogError: There is no `=`.
    """
    from fleet2d.logs.log import LogError

    label, mark, kind = text.rpartition("=")
    if not mark:
        raise LogError(f"--rooms: expected LABEL=KIND, such as M003=bedroom, got {text!r}")
    return label, kind


def table(validation: "Validation") -> list[str]:
    """Return the distances of a validation as lines of text."""
    from fleet2d.learning.fit.validation import MODELS

    lines = [
        f"{validation.days} days in {validation.folds} parts, each held back in turn: distances of"
        " days sampled from models of the other parts",
        f"{'':30}{'time shares':>12}{'by hour':>10}{'stays KS':>10}{'stays [min]':>12}"
        f"{'transitions':>13}",
    ]
    for title, distances in (
        ("rooms", validation.rooms),
        ("activities", validation.activities),
        ("rooms, to the second", validation.seconds),
    ):
        lines.append(title)
        lines += [
            f"  {name:28}{d.share:12.3f}{d.hours:10.3f}{d.ks:10.3f}{d.stay_min:12.1f}"
            f"{d.transitions:13.3f}"
            for name, d in zip(MODELS, distances, strict=True)
        ]
    worse = validation.worse_than_copying()
    verdict = "; ".join(worse) or "in no distance of rooms"
    lines.append(f"the persona is worse than copies of whole days: {verdict}")
    return lines


def privacy(fitted: "FittedPersona", private: bool) -> list[str]:
    """Return how much of its log a persona repeats, as lines of text."""
    from fleet2d.learning.fit.privacy import repeats
    from fleet2d.learning.fit.validation import simulated_repeats

    lines = [
        "successive changes of activity, to the minute, that a day shares with one of the log:",
        f"  simulated days: {simulated_repeats(fitted)}",
        f"  days of the log, with each other: {repeats(fitted.log, fitted.log)}",
    ]
    verdict = (
        "no day of the log is in the persona; docs/how-to/fit.md says what it still tells"
        if private
        else "the persona holds every day of the log to the second: --private, to give it away"
    )
    return [*lines, verdict]


@fitting.command(
    "perception",
    help="Fit a camera's perception to a log of detections.\n\n"
    "Fitted are the probabilities of noticing and recognizing people.\n\nExamples:\n"
    "  fleet2d fit perception detections.csv --out perception.yaml --robot astro",
)
def calibrate_perception(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="DETECTIONS.csv",
            help="Columns distance [m] and detected (0 or 1); if known bearing_deg,"
            " orientation_deg, identity and true_identity.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="The scenario fragment to write.")] = Path(
        "perception.yaml"
    ),
    picture: Annotated[
        Path | None, typer.Option(help="Picture of the fit to write, .png or .svg.")
    ] = None,
    robot: Annotated[str, typer.Option(help="The robot that the fragment is about.")] = "astro",
    extends: Annotated[
        str | None, typer.Option(help="A scenario that the fragment extends, to run it as it is.")
    ] = None,
) -> list[str]:
    """Fit a perception to a log, write it as a scenario fragment, and return a report in lines.

    Args:
        path: The log.
        out: The file of the fragment.
        picture: The file of a picture of the fit; None: no picture.
        robot: The robot's name in the scenario.
        extends: A scenario that the fragment extends; None: other scenarios extend the fragment.

    Raises:
        InputError: The log can't be read or fitted, a file can't be written, or scipy is missing.
    """
    from fleet2d.errors import InputError, extra, os_errors_as

    with extra("calibrate", "fitting a camera needs scipy"):
        from fleet2d.learning.fit.perception import calibrate, read_detections

    if picture is not None:
        from fleet2d.viewing.pictures.floorplan import check_picture

        check_picture(picture)
    calibration = calibrate(read_detections(path))
    with os_errors_as(InputError, f"{out} can't be written"):
        out.write_text(fragment(calibration, robot, extends), encoding="utf-8")
    if picture is not None:
        from fleet2d.learning.fit.picture import draw_calibration

        draw_calibration(calibration, picture)
    return [*report(calibration), f"wrote {out}", *([f"wrote {picture}"] if picture else [])]


def fragment(calibration: "Calibration", robot: str, extends: str | None) -> str:
    """Return a scenario fragment in which the robot notices people as fitted."""
    import yaml

    top: dict[str, Any] = {} if extends is None else {"extends": extends}
    top["robots"] = {robot: {"camera": {"detection": 1}, "perception": calibration.section()}}
    text = yaml.safe_dump(top, sort_keys=False, default_flow_style=None, allow_unicode=True)
    return (
        f"# Fitted to {len(calibration.log)} rows of {calibration.log.path.name} by"
        f" `fleet2d fit perception`.\n{text}"
    )


def report(calibration: "Calibration") -> list[str]:
    """Return a report of a fit in lines: estimates, omitted factors, and goodness of fit."""
    log = calibration.log
    lines = [
        f"{log.path.name}: {int(log.detected.sum())} detections in {len(log)} times in view",
        "",
        "noticed (95 % intervals in brackets)",
        *_lines_of(calibration.detection),
    ]
    if calibration.identity is not None:
        identity = calibration.identity
        lines += ["", "recognized, if noticed", *_lines_of(identity.right)]
        lines.append(f"  of the others, taken for somebody else: {identity.mistaken}")
        for user, others in identity.confusion.items():
            shares = ", ".join(f"{name} {share:.2g}" for name, share in others.items())
            lines.append(f"  {user} is taken for: {shares}")
    return [*lines, *calibration.notes, ""]


def _lines_of(fitted: "FittedProbability") -> list[str]:
    lines = [
        f"  {name}: {estimate}{UNITS.get(name.split()[0], '')}"
        for name, estimate in fitted.estimates.items()
    ]
    lines += [f"  {name}: left out: {reason}" for name, reason in fitted.omitted.items()]
    freedom = sum(group.rows for group in fitted.groups) - len(fitted.estimates)
    verdict = "the model fits" if fitted.p_value > 0.05 else "the model misses something"
    lines.append(
        f"  fit: deviance {fitted.fit.deviance:.1f} on {freedom} degrees of freedom; predicted"
        f" against observed: chi2 {fitted.chi_square:.1f}, p = {fitted.p_value:.2g}: {verdict}"
    )
    lines.append("    predicted  observed (95 %)")
    lines += [f"    {group.predicted:9.3f}  {group.observed}" for group in fitted.groups]
    return lines
