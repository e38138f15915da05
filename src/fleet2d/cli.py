"""The command line: `fleet2d run`, `validate`, `show` and the rest; see `fleet2d --help`."""

import json
import os
import re
import sys
import time
from collections.abc import Collection
from contextlib import suppress
from dataclasses import asdict
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from fleet2d.calibrate.command import calibrating
from fleet2d.errors import Fleet2DError, InputError, RunDirectoryError
from fleet2d.fit.command import fitting

if TYPE_CHECKING:
    from fleet2d.artifacts.reader import Run
    from fleet2d.engine.simulation import Simulation

_LOADED = time.perf_counter()

app = typer.Typer(
    help="Simulate weeks of a home in a fraction of a second, exactly reproducible.",
    no_args_is_help=True,
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(fitting, name="fit")
app.add_typer(calibrating, name="calibrate")

Arguments = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[SCENARIO.yaml] [KEY.PATH=VALUE]...",
        help="A scenario (left out: the bundled base scenario), and changes to it.",
    ),
]

Resolution = Annotated[
    float | None,
    typer.Option(help="Metres per pixel, of a floor plan that is a mere picture."),
]


@app.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Simulate weeks of a home in a fraction of a second, exactly reproducible."""
    if version:
        import fleet2d

        typer.echo(f"fleet2d {fleet2d.__version__}")
        raise typer.Exit


@app.command()
def run(
    arguments: Arguments = None,
    seed: Annotated[int | None, typer.Option(help="The seed of all randomness.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory for the run.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Simulate a scenario and store the run."""
    scenario, overrides = _split(arguments)
    if not quiet:
        _announce_compilation()
    from fleet2d.engine.simulation import Simulation
    from fleet2d.scenario.model import load_scenario

    settings = {} if seed is None else {"seed": seed}
    loaded = load_scenario(scenario, *overrides, **settings)
    name = loaded.name or (Path(scenario).stem if scenario else "run")
    directory = out or _fresh_directory(name)
    try:
        simulation = Simulation(loaded, out=directory)
    except BaseException:
        if out is None:
            with suppress(OSError):
                directory.rmdir()
                directory.parent.rmdir()  # if it was the first run here
        raise
    try:
        stored = _run_with_progress(simulation, show=sys.stderr.isatty() and not quiet)
    except KeyboardInterrupt:
        typer.echo(
            f"interrupted at {simulation.time:%Y-%m-%d %H:%M}; what was simulated until then is in"
            f" {simulation.directory}",
            err=True,
        )
        raise typer.Exit(130) from None
    summary = _summary(stored)
    if as_json:
        typer.echo(json.dumps(summary))
    elif not quiet:
        _print_summary(summary, stored)


@app.command()
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
    """Check a scenario, and that everybody can be where they should; or a floor plan."""
    from fleet2d.floorplan.load import is_floorplan

    scenario, overrides = _split(arguments)
    if scenario is not None and is_floorplan(scenario):
        if overrides:
            raise InputError(f"{scenario} is a floor plan: {overrides[0]} changes a scenario")
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
    for note in plan.notes:
        typer.echo(f"note: {note}")
    for actor in simulation.actors.values():
        for behavior in actor.behaviors:
            for note in getattr(behavior, "notes", ()):  # what it made of its input
                typer.echo(f"note: {actor.path}: {note}")


@app.command()
def schema(
    floorplan: Annotated[
        bool, typer.Option("--floorplan", help="That of a floor plan in Fleet2D's own format.")
    ] = False,
) -> None:
    """Print the JSON Schema of a scenario, for completion in an editor."""
    if floorplan:
        from fleet2d.floorplan.native_schema import native_schema

        typer.echo(json.dumps(native_schema(), indent=2))
        return
    from fleet2d.scenario.schema import schema as scenario_schema

    typer.echo(json.dumps(scenario_schema(), indent=2))


@app.command()
def components(
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON list.")] = False,
) -> None:
    """List every registered type, with its fields, units and defaults."""
    from fleet2d.scenario.schema import describe_components

    described = describe_components()
    if as_json:
        typer.echo(json.dumps([asdict(component) for component in described], indent=2))
        return
    for component in described:
        names = " or ".join((component.type, *component.aliases))
        typer.echo(f"{component.kind}: {names}\n    {component.summary}")
        for field in component.fields:
            default = "required" if field.default is None else f"= {field.default or repr('')}"
            typer.echo(f"    {field.name}: {field.type} {default}")
            if field.description:
                typer.echo(f"        {field.description}")
        typer.echo("")


@app.command()
def show(
    what: Annotated[
        Path | None,
        typer.Argument(metavar="[FLOORPLAN|RUN_DIR]", help="Left out: the bundled home."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Picture to write, .png or .svg.")] = None,
    resolution: Resolution = None,
    layer: Annotated[
        str | None, typer.Option(help="Of a run: draw this layer, such as explored.astro.")
    ] = None,
    step: Annotated[
        int | None, typer.Option(help="With --layer: as it was after this step; else the last.")
    ] = None,
    fov: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,HEADING[,RANGE,ANGLE]",
            help="Of a floor plan: draw what is in view of a pose [m, degrees].",
        ),
    ] = None,
) -> None:
    """Draw a floor plan of any format, or a stored run in its home."""
    is_run = what is not None and (what / "manifest.json").exists()
    if fov is not None if is_run else layer is not None or step is not None:
        raise InputError("--layer and --step are for a run's directory, --fov for a floor plan")
    if what is not None and is_run:
        from fleet2d.artifacts.reader import open_run

        if layer is not None:
            from fleet2d.view.layers import draw_layer

            target = out or what / f"{layer}.png"
            draw_layer(open_run(what), layer, target, step)
        else:
            from fleet2d.view.run import draw_run

            target = out or what / "picture.png"
            draw_run(open_run(what), target)
    elif what is not None and what.is_dir():
        raise RunDirectoryError(f"{what} holds no run: give a run directory or a floor plan's file")
    else:
        from fleet2d.floorplan.load import load_floorplan
        from fleet2d.view.floorplan import draw_floorplan

        plan = load_floorplan(what, resolution=resolution) if what else load_floorplan()
        target = out or Path(f"{_file_name(plan.name) or 'plan'}.png")
        if fov is not None:
            from fleet2d.view.fov import draw_fov, parse_pose

            draw_fov(plan, parse_pose(fov), target)
        else:
            draw_floorplan(plan, target)
    typer.echo(target)


@app.command()
def convert(
    old: Annotated[
        Path,
        typer.Argument(
            help="A floor plan of any format, or a configuration of the published Fleet2D."
        ),
    ],
    new: Annotated[
        Path,
        typer.Argument(help="The floor plan (.json, .yaml, .geojson) or the scenario to write."),
    ],
    resolution: Resolution = None,
) -> None:
    """Turn a floor plan into Fleet2D's own format, or a published configuration into a scenario."""
    from fleet2d.floorplan.load import is_floorplan, load_floorplan

    if is_floorplan(old):
        from fleet2d.floorplan.save import save_floorplan

        plan = load_floorplan(old, resolution=resolution)
        save_floorplan(plan, new)
        remarks = list(plan.notes)
    else:
        from fleet2d.scenario.published import convert_file

        remarks = convert_file(old, new)
    for remark in remarks:
        typer.echo(f"note: {remark}")
    typer.echo(new)


@app.command()
def export(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
    out: Annotated[Path, typer.Argument(help="The text file to write.")],
) -> None:
    """Write what a run's sensors said as smart-home tools read it: in the layout of CASAS."""
    from fleet2d.artifacts.casas import write_casas
    from fleet2d.artifacts.reader import open_run

    count = write_casas(open_run(directory), out)
    typer.echo(f"{count} readings in {out}")


@app.command()
def reproduce(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
) -> None:
    """Run a stored run again from its manifest, and compare."""
    from fleet2d.engine.run import reproduce as run_again

    result = run_again(directory)
    for cause in result.causes:
        typer.echo(f"note: {cause}")
    if result.same:
        typer.echo(f"reproduced: digest {result.digest}")
        return
    typer.echo(f"not reproduced: {', '.join(result.differing)} came out different", err=True)
    raise typer.Exit(1)


def main() -> NoReturn:
    """Run the command line; exit 0 done, 2 wrong input, 1 our fault, 130 interrupted."""
    try:
        app(standalone_mode=True)
    except InputError as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(2)
    except Fleet2DError as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(0)


def _check_floorplan(
    source: str, out: Path | None, radius: float, resolution: float | None
) -> None:
    """Print a floor plan's findings and draw them; exit with 2 if nobody can live there."""
    from fleet2d.floorplan.checkup import checkup
    from fleet2d.floorplan.load import load_floorplan
    from fleet2d.view.checkup import draw_checkup

    plan = load_floorplan(source, resolution=resolution)
    findings = checkup(plan, radius)
    target = out or Path(f"{_file_name(plan.name) or 'plan'}-checkup.png")
    draw_checkup(plan, findings, target)
    typer.echo(f"{plan.name}: {plan.area_m2:.1f} m2, {_count(plan.rooms, 'room')}")
    for number, finding in enumerate(findings, start=1):
        typer.echo(f"{number:>3} {finding.severity}: {finding.text}")
    if not findings:
        typer.echo("ok: nothing wrong or odd was found")
    for note in plan.notes:
        typer.echo(f"note: {note}")
    typer.echo(target)
    if any(finding.severity == "unlivable" for finding in findings):
        raise typer.Exit(2)


def _count(things: Collection[Any], noun: str) -> str:
    return f"{len(things)} {noun}{'' if len(things) == 1 else 's'}"


def _split(arguments: list[str] | None) -> tuple[str | None, list[str]]:
    """Tell the scenario from the overrides: it comes first, and has no '='."""
    rest = list(arguments or [])
    if rest and "=" not in rest[0]:
        return rest[0], rest[1:]
    return None, rest


def _fresh_directory(name: str) -> Path:
    """Make and return runs/NAME-001, or the first number that is free."""
    plain = _file_name(name) or "run"
    number = 1
    while True:
        directory = Path("runs") / f"{plain}-{number:03d}"
        try:
            directory.mkdir(parents=True)  # so that a run started beside this one takes the next
        except FileExistsError:
            number += 1
        except OSError as error:
            raise RunDirectoryError(
                f"{directory} can't be made: {error.strerror}; name another directory by --out"
            ) from error
        else:
            return directory


def _file_name(name: str) -> str:
    """Return what of a name can be a file's, wherever it comes from."""
    return re.sub(r"[^\w.-]+", "-", name).strip(".-")


def _announce_compilation() -> None:
    from fleet2d.kernels._jit import cache_directory

    if not cache_directory().exists():
        text = "compiling the kernels, once on this machine: 10 to 20 s of this first run …"
        typer.echo(text, err=True)


def _run_with_progress(simulation: "Simulation", *, show: bool) -> "Run":
    if not show:
        return simulation.run()
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=simulation.clock.steps)
        began = time.perf_counter()

        def tell(now: "Simulation") -> None:
            simulated = now.step * now.clock.step_us / 1e6
            speedup = simulated / (time.perf_counter() - began)
            text = f"{now.time:%a %d %b %Y %H:%M}  {speedup:,.0f} x real time"
            progress.update(task, completed=now.step, description=text)

        return simulation.run(tell)


def _summary(stored: "Run") -> dict[str, Any]:
    manifest = stored.manifest
    wall = {**manifest["wall_s"], "total": _since_start()}
    return {
        "run_dir": str(stored.directory),
        "steps": manifest["steps"],
        "simulated_s": manifest["simulated_s"],
        "seed": manifest["seed"],
        "digest": stored.digest,
        "wall_s": wall,
        "speedup": manifest["simulated_s"] / (wall["setup"] + wall["simulate"] + wall["save"]),
        "peak_rss_mb": _peak_rss_mb(),
        "metrics": stored.metrics,
    }


def _print_summary(summary: dict[str, Any], stored: "Run") -> None:
    from rich.console import Console
    from rich.table import Table

    from fleet2d.units import format_duration

    console = Console()
    wall = summary["wall_s"]
    simulated = format_duration(timedelta(seconds=summary["simulated_s"]))
    seconds = wall["setup"] + wall["simulate"] + wall["save"]
    console.print(
        f"{simulated} in {seconds:.2f} s: {summary['speedup']:,.0f} x real time"
        f" (set-up {wall['setup']:.2f} s, simulate {wall['simulate']:.2f} s,"
        f" save {wall['save']:.2f} s;"
        f" whole process {wall['total']:.2f} s, {summary['peak_rss_mb']:.0f} MB)",
        highlight=False,
        soft_wrap=True,
    )
    table = Table("metric", "of", "value", "", show_edge=False)
    for metric, result in summary["metrics"].items():
        of = unit = _unit_of(stored, metric)
        for name, value in _flat(result):
            shown = _shown(value, unit or of)
            table.add_row(metric, name, shown, unit)
            metric = unit = ""
    if table.row_count:
        console.print(table)
    for note in stored.notes or stored.manifest["notes"]:
        console.print(f"note: {note}", highlight=False)
    console.print(f"seed {summary['seed']}, digest {summary['digest'][:16]}", highlight=False)
    console.print(f"stored in {summary['run_dir']}", highlight=False, soft_wrap=True)


def _shown(value: Any, unit: str) -> str:
    """Return a number as people read it: shares in percent, few digits."""
    if not isinstance(value, float):
        return str(value)
    if unit.startswith("share"):
        return f"{100 * value:.1f} %" if value >= 0.001 or value == 0 else "< 0.1 %"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _unit_of(stored: "Run", metric: str) -> str:
    """Return the unit that a metric's class declares."""
    from fleet2d.component import lookup

    configured = stored.manifest["scenario"]["metrics"][metric]
    unit: str = getattr(lookup("metric", configured["type"]), "unit", "")
    return unit


def _flat(result: Any, prefix: str = "") -> list[tuple[str, Any]]:
    if not isinstance(result, dict):
        return [(prefix, result)]
    return [
        row
        for key, value in result.items()
        for row in _flat(value, f"{prefix} · {key}" if prefix else key)
    ]


def _since_start() -> float:
    """Return the wall time since this process began [s]."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (
        OSError,
        AttributeError,
        ValueError,
        IndexError,
    ):  # not Linux: since this module was loaded
        return time.perf_counter() - _LOADED


def _peak_rss_mb() -> float | None:
    """Return the most memory that this process has held [MB]; None where nobody says."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024 * 1024 if sys.platform == "darwin" else 1024)


if __name__ == "__main__":
    main()
