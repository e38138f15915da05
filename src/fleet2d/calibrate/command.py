"""The command `fleet2d calibrate`: what it prints and writes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from fleet2d.calibrate.perception import Calibration, FittedProbability

calibrating = typer.Typer(help="Fit a model to a log of a real device.", no_args_is_help=True)

# A callback, as typer would otherwise drop the name of the only subcommand.
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
    """Fit the probabilities of noticing and recognizing people to a log of a robot's detections."""
    for line in calibrate_perception(detections, out, picture, robot, extends):
        typer.echo(line)


def calibrate_perception(
    path: Path,
    out: Path,
    picture: Path | None = None,
    robot: str = "astro",
    extends: str | None = None,
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
    from fleet2d.calibrate.log import read_log
    from fleet2d.calibrate.perception import calibrate
    from fleet2d.errors import InputError

    if picture is not None:
        from fleet2d.pictures.floorplan import check_picture

        check_picture(picture)
    calibration = calibrate(read_log(path))
    try:
        out.write_text(fragment(calibration, robot, extends), encoding="utf-8")
        if picture is not None:
            from fleet2d.calibrate.picture import draw_fit

            draw_fit(calibration, picture)
    except OSError as error:
        raise InputError(f"{error.filename} can't be written: {error.strerror}") from None
    return [*report(calibration), f"wrote {out}", *([f"wrote {picture}"] if picture else [])]


def fragment(calibration: "Calibration", robot: str, extends: str | None) -> str:
    """Return a scenario fragment in which the robot notices people as fitted."""
    import yaml

    top: dict[str, Any] = {} if extends is None else {"extends": extends}
    top["robots"] = {robot: {"camera": {"detection": 1}, "perception": calibration.section()}}
    text = yaml.safe_dump(top, sort_keys=False, default_flow_style=None, allow_unicode=True)
    return (
        f"# Fitted to {len(calibration.log)} rows of {calibration.log.path.name} by"
        f" `fleet2d calibrate perception`.\n{text}"
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
