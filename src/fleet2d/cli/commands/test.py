"""`fleet2d test`: scenarios with expectations, run with several seeds and judged."""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fleet2d.cli.scenario_case import ScenarioCase
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.options import file_name

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation

FIRST_SEED = 1
MOST_STORED = 5
"""The most failing seeds of one scenario that are stored or drawn."""


def test(
    arguments: Annotated[
        list[str],
        typer.Argument(
            metavar="SCENARIO.yaml... [KEY.PATH=VALUE]...",
            help="Scenarios with expectations, and changes to all of them.",
        ),
    ],
    seeds: Annotated[int, typer.Option(min=1, help="The number of seeds of each.")] = 1,
    seed: Annotated[
        int | None, typer.Option(min=0, help="The first seed; left out: the scenario's own, or 1.")
    ] = None,
    junit: Annotated[Path | None, typer.Option(help="JUnit XML to write.")] = None,
    pictures: Annotated[
        Path | None, typer.Option(help="Folder for a picture of the worst moment of each failure.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the run directories of seeds that fail.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Run scenarios and judge their expectations; exit code 1 if one is violated."""
    files = [argument for argument in arguments if "=" not in argument]
    overrides = [argument for argument in arguments if "=" in argument]
    if not files:
        raise InputError("name the scenarios to test: fleet2d test SCENARIO.yaml…")
    if pictures is not None:
        _check_pictures()
    cases = [case for file in files for case in _cases(file, overrides, seeds, seed)]
    failures: Counter[str] = Counter()
    for case in cases:
        _run(case)
        if case.fails and not case.error and (pictures or out):
            failures[case.source] += 1
            if failures[case.source] <= MOST_STORED:
                _store(case, pictures, out)
    if junit is not None:
        from fleet2d.cli.junit import write_junit

        write_junit(junit, cases)
    if as_json:
        typer.echo(json.dumps([_content(case) for case in cases]))
    else:
        from fleet2d.cli.verdicts import print_cases

        print_cases(cases)
    if any(case.fails for case in cases):
        raise typer.Exit(1)


def _cases(
    source: str, overrides: Sequence[str], seeds: int, seed: int | None
) -> Iterator[ScenarioCase]:
    """Yield a scenario with each of its seeds, after a check of its set-up.

    Raises:
        InputError: The scenario or an expectation is wrong, or it has no expectations.
    """
    from fleet2d.engine.simulation import Simulation
    from fleet2d.scenario.model import load_scenario

    scenario = load_scenario(source, *overrides)
    if not scenario.expect:
        raise InputError(
            f"{source} has no expectations: write, for example,\n"
            "  expect: {keeps_off: 'always(distance(ana, astro) > 0.5 m)'}"
        )
    if seed is None:
        seed = scenario.simulation.seed
    first_seed = FIRST_SEED if seed is None else seed
    Simulation(scenario)
    for number in range(first_seed, first_seed + seeds):
        simulation = scenario.simulation.model_copy(update={"seed": number})
        yield ScenarioCase(
            source, scenario.model_copy(update={"simulation": simulation}), overrides
        )


def _run(case: ScenarioCase) -> None:
    """Run a case, and judge it."""
    import time

    start_s = time.perf_counter()
    try:
        simulation = _simulation(case)
        simulation.run()
        case.verdicts = simulation.verdicts()
    except Fleet2DError as error:
        case.error = str(error)
    case.wall_s = time.perf_counter() - start_s


def _simulation(case: ScenarioCase, out: Path | None = None) -> "Simulation":
    from fleet2d.engine.simulation import Simulation

    return Simulation(case.scenario, out=out)


def _store(case: ScenarioCase, pictures: Path | None, out: Path | None) -> None:
    """Run a failed case again, to store it and to draw the worst moments."""
    directory = None if out is None else out / case.name
    run = _simulation(case, directory).run()
    if directory is not None:
        case.files.append(directory)
    if pictures is None:
        return
    from fleet2d.viewer.scenes.figures import draw_moment

    pictures.mkdir(parents=True, exist_ok=True)
    for verdict in case.verdicts.values():
        worst = verdict.worst
        if worst is not None:
            path = pictures / f"{case.name}-{file_name(verdict.name)}.png"
            draw_moment(run, worst.worst, path)
            case.files.append(path)


def _check_pictures() -> None:
    """Check that pictures can be drawn, before anything is run.

    Raises:
        InputError: matplotlib is missing.
    """
    from importlib.util import find_spec

    if find_spec("matplotlib") is None:
        raise InputError("--pictures needs matplotlib: pip install 'fleet2d[viz]'")


def _content(case: ScenarioCase) -> dict[str, Any]:
    return {
        "scenario": case.source,
        "seed": case.seed,
        "holds": not case.fails,
        "error": case.error or None,
        "wall_s": case.wall_s,
        "expectations": {name: verdict.content() for name, verdict in case.verdicts.items()},
        "files": [str(path) for path in case.files],
    }
