"""The command `fleet2d calibrate`: what it prints and writes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from fleet2d.calibrate.perception import Calibration, Curves

calibrating = typer.Typer(help="Fit a model to a log of a real device.", no_args_is_help=True)

# So that `fleet2d calibrate` keeps its subcommands when there is one of them only.
calibrating.callback()(lambda: None)

UNITS = {"distance": " m", "bearing": " deg"}


@calibrating.command()
def perception(
    detections: Annotated[
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
) -> None:
    """Fit when people are noticed, and recognized, to a log of a robot's detections."""
    for line in calibrate_perception(detections, out, picture, robot, extends):
        typer.echo(line)


def calibrate_perception(
    path: Path,
    out: Path,
    picture: Path | None = None,
    robot: str = "astro",
    extends: str | None = None,
) -> list[str]:
    """Fit a perception to a log, write it as a scenario fragment, and return what to say about it.

    Args:
        path: The log.
        out: The fragment's file.
        picture: Where to draw the fit; None: nowhere.
        robot: The robot's name in the scenario.
        extends: A scenario that the fragment extends; None: it is for others to extend.

    Raises:
        InputError: The log can't be read, or tells nothing; or a file can't be written.
    """
    from fleet2d.calibrate.log import read_log
    from fleet2d.calibrate.perception import calibrate
    from fleet2d.errors import InputError

    if picture is not None:
        from fleet2d.view.floorplan import check_picture

        check_picture(picture)
    found = calibrate(read_log(path))
    try:
        out.write_text(fragment(found, robot, extends), encoding="utf-8")
        if picture is not None:
            from fleet2d.calibrate.picture import draw_fit

            draw_fit(found, picture)
    except OSError as error:
        raise InputError(f"{error.filename} can't be written: {error.strerror}") from None
    return [*report(found), f"wrote {out}", *([f"wrote {picture}"] if picture else [])]


def fragment(found: "Calibration", robot: str, extends: str | None) -> str:
    """Return a scenario fragment: the robot's camera notices by the fit alone."""
    import yaml

    top: dict[str, Any] = {} if extends is None else {"extends": extends}
    top["robots"] = {robot: {"camera": {"detection": 1}, "perception": found.section()}}
    text = yaml.safe_dump(top, sort_keys=False, default_flow_style=None, allow_unicode=True)
    return (
        f"# Fitted to {len(found.log)} rows of {found.log.path.name} by"
        f" `fleet2d calibrate perception`.\n{text}"
    )


def report(found: "Calibration") -> list[str]:
    """Return what to say about a fit."""
    log = found.log
    lines = [
        f"{log.path.name}: {int(log.detected.sum())} detections in {len(log)} times in view",
        "",
        "noticed (95 % intervals in brackets)",
        *_curves(found.detection),
    ]
    if found.identity is not None:
        who = found.identity
        lines += ["", "recognized, if noticed", *_curves(who.right)]
        lines.append(f"  of the others, taken for somebody else: {who.mistaken}")
        for user, others in who.confusion.items():
            told = ", ".join(f"{name} {share:.2g}" for name, share in others.items())
            lines.append(f"  {user} is taken for: {told}")
    return [*lines, *found.notes, ""]


def _curves(curves: "Curves") -> list[str]:
    lines = [
        f"  {name}: {estimate}{UNITS.get(name.split()[0], '')}"
        for name, estimate in curves.estimates.items()
    ]
    lines += [f"  {name}: left out: {why}" for name, why in curves.left_out.items()]
    freedom = sum(group.rows for group in curves.groups) - len(curves.estimates)
    fits = "the model fits" if curves.p_value > 0.05 else "the model misses something"
    lines.append(
        f"  fit: deviance {curves.fit.deviance:.1f} on {freedom} degrees of freedom; predicted"
        f" against observed: chi2 {curves.chi_square:.1f}, p = {curves.p_value:.2g}: {fits}"
    )
    lines.append("    predicted  observed (95 %)")
    lines += [f"    {group.predicted:9.3f}  {group.observed}" for group in curves.groups]
    return lines
