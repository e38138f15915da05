"""`fleet2d test`: run scenarios with expectations; the table of verdicts and JUnit XML."""

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from xml.etree import ElementTree as ET

import typer

from fleet2d.cli.run import Strict, report_wrong
from fleet2d.configuration.problems import counted
from fleet2d.errors import Fleet2DError, InputError, os_errors_as
from fleet2d.options import file_name
from fleet2d.storage.files import write_atomically

if TYPE_CHECKING:
    from fleet2d.expectations.verdict import Verdict
    from fleet2d.scenario.model import Scenario


@dataclass
class ScenarioCase:
    """A scenario with a seed, and its results.

    Attributes:
        source: The file of the scenario, as on the command line.
        scenario: The scenario, with the seed.
        overrides: Changes of the scenario, as on the command line.
        home: The name of the home, of several; empty for the scenario's own.
        verdicts: The verdicts on expectations, by name.
        error: The error that ended the run; empty if there is none.
        wall_s: The wall time of the run [s].
        files: The run directory and pictures of a failure.
    """

    source: str
    scenario: "Scenario"
    overrides: Sequence[str]
    home: str = ""
    verdicts: "Mapping[str, Verdict]" = field(default_factory=dict)
    error: str = ""
    wall_s: float = 0.0
    files: list[Path] = field(default_factory=list)

    @property
    def seed(self) -> int:
        """The seed."""
        assert self.scenario.simulation.seed is not None
        return self.scenario.simulation.seed

    @property
    def fails(self) -> bool:
        """Whether the run failed or violates an expectation."""
        return bool(self.error) or any(v.fails for v in self.verdicts.values())

    @property
    def label(self) -> str:
        """The home, of several, and the seed."""
        return f"home {self.home}, seed {self.seed}" if self.home else f"seed {self.seed}"

    @property
    def name(self) -> str:
        """The name of its run directory and pictures."""
        home = f"-{file_name(self.home)}" if self.home else ""
        return f"{file_name(Path(self.source).stem) or 'run'}{home}-seed-{self.seed}"

    def commands(self, verdict: "Verdict") -> str:
        """Return the commands that run it and show the worst moment of a verdict."""
        changes = " ".join(f"'{override}'" for override in self.overrides)
        run = f"fleet2d run {self.source} {changes}".rstrip()
        worst = verdict.worst
        moment = f" --at 'step {worst.worst}'" if worst is not None else ""
        return f"{run} --seed {self.seed} --out {self.name} && fleet2d show {self.name}{moment}"


# Characters that XML 1.0 can't contain.
_ILLEGAL = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(path: Path, cases: "Sequence[ScenarioCase]") -> None:
    """Write a test suite for each scenario, with a test for each expectation and seed.

    Raises:
        InputError: The file can't be written.
    """
    root = ET.Element("testsuites")
    for source in dict.fromkeys(case.source for case in cases):
        cases_of_source = [case for case in cases if case.source == source]
        suite = ET.SubElement(root, "testsuite", name=_xml_text(source))
        for case in cases_of_source:
            _add_case(suite, case)
        counts = Counter(outcome.tag for outcome in suite.iterfind("testcase/*"))
        suite.set("tests", str(len(suite)))
        suite.set("failures", str(counts["failure"]))
        suite.set("errors", str(counts["error"]))
        suite.set("skipped", str(counts["skipped"]))
        suite.set("time", f"{sum(case.wall_s for case in cases_of_source):.3f}")
    ET.indent(root)
    text = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    with os_errors_as(InputError, f"--junit {path} can't be written"):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)


def _add_case(suite: ET.Element, case: "ScenarioCase") -> None:
    names = list(case.verdicts) or list(case.scenario.expect)
    for name in names:
        test = ET.SubElement(
            suite,
            "testcase",
            classname=_xml_text(Path(case.source).stem),
            name=f"{_xml_text(name)}[{_xml_text(case.label)}]",
            time=f"{case.wall_s / len(names):.3f}",
        )
        if case.error:
            error = ET.SubElement(test, "error", message=_xml_text(case.error))
            error.text = _xml_text(case.error)
            return
        verdict = case.verdicts[name]
        if verdict.fails:
            failure = ET.SubElement(test, "failure", message=_xml_text(str(verdict)))
            files = "".join(f"\nstored: {path}" for path in case.files)
            failure.text = _xml_text(f"{verdict}\nto see it: {case.commands(verdict)}{files}")
        elif verdict.holds is None:
            ET.SubElement(test, "skipped", message=_xml_text(str(verdict)))


def _xml_text(text: str) -> str:
    return _ILLEGAL.sub("?", text)


def print_cases(cases: "Sequence[ScenarioCase]") -> None:
    """Print a table of expectations, then the failures."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, markup=False, soft_wrap=True)
    all_verdicts = [v for case in cases for v in case.verdicts.values()]
    has_untested = any(v.holds is None for v in all_verdicts)
    has_occasions = any(v.occasions is not None for v in all_verdicts)
    columns = [*(["untested"] * has_untested), *(["occasions"] * has_occasions)]
    table = Table("scenario", "expectation", "held", *columns, "at least by", show_edge=False)
    for source in dict.fromkeys(case.source for case in cases):
        cases_of_source = [case for case in cases if case.source == source]
        for number, name in enumerate(cases_of_source[0].scenario.expect):
            verdicts = [case.verdicts[name] for case in cases_of_source if name in case.verdicts]
            held = f"{sum(v.holds is True for v in verdicts)} of {len(cases_of_source)}"
            numbers = [str(sum(v.holds is None for v in verdicts) or "")] if has_untested else []
            if has_occasions:
                occasions = [v.occasions for v in verdicts if v.occasions is not None]
                numbers.append(str(sum(occasions)) if occasions else "")
            table.add_row("" if number else source, name, held, *numbers, _lowest(verdicts))
    console.print(table, soft_wrap=False)
    notes = dict.fromkeys(note for verdict in all_verdicts for note in verdict.notes)
    failures = [line for case in cases for line in _failure_lines(case)]
    failed = sum(case.fails for case in cases)
    runs = counted(len(cases), "run")
    end = f"{failed} of {runs} failed" if failed else f"all held: {runs}"
    console.print(*(f"note: {note}" for note in notes), *failures, end, sep="\n")


def _failure_lines(case: "ScenarioCase") -> list[str]:
    prefix = f"{case.source}, {case.label}: "
    lines = [f"{prefix}{case.error}"] if case.error else []
    for verdict in case.verdicts.values():
        if verdict.fails:
            lines += [f"{prefix}{verdict}", f"  to see it: {case.commands(verdict)}"]
    return [*lines, *(f"  stored: {path}" for path in case.files)]


def _lowest(verdicts: "Sequence[Verdict]") -> str:
    """Return the lowest robustness of verdicts as text, else the shortest time to spare."""
    from math import isfinite

    from fleet2d.expectations.verdict import amount

    measured = [verdict for verdict in verdicts if isfinite(verdict.robustness)]
    if measured:
        worst = min(measured, key=lambda verdict: verdict.robustness)
        return amount(worst.robustness, worst.unit)
    slack = [verdict.slack_s for verdict in verdicts if verdict.slack_s is not None]
    return f"{min(slack):g} s to spare" if slack else ""


FIRST_SEED = 1
MAX_STORED_SEEDS = 5
"""Maximum number of failing seeds of one scenario that are stored or drawn."""


def test(  # noqa: PLR0913 - options of the command line
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
    homes: Annotated[
        str | None,
        typer.Option(
            metavar="NUMBER|PATH",
            help="Run each in so many synthetic homes, or in the floor plans of a folder.",
        ),
    ] = None,
    junit: Annotated[Path | None, typer.Option(help="JUnit XML to write.")] = None,
    pictures: Annotated[
        Path | None, typer.Option(help="Folder for a picture of the worst moment of each failure.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the run directories of seeds that fail.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    strict: Strict = False,
) -> None:
    """Run scenarios and check their expectations.

    The exit code is 1 if one is violated.

    Examples:
      fleet2d test home.yaml --seeds 20
      fleet2d test home.yaml --homes 10 --junit results.xml --pictures failures
    """
    files = [argument for argument in arguments if "=" not in argument]
    overrides = [argument for argument in arguments if "=" in argument]
    if not files:
        raise InputError("name the scenarios to test: fleet2d test SCENARIO.yaml…")
    if pictures is not None:
        import fleet2d.viewing.pictures  # noqa: F401 - an error before anything is run, if matplotlib is missing
    cases = [
        case
        for file in files
        for home, change in _homes(homes, file, overrides)
        for case in _cases(file, [*overrides, *change], seeds, seed, home, strict=strict)
    ]
    failures: Counter[str] = Counter()
    for case in cases:
        _run(case)
        if case.fails and not case.error and (pictures or out):
            failures[case.source] += 1
            if failures[case.source] <= MAX_STORED_SEEDS:
                _store(case, pictures, out)
    if junit is not None:
        write_junit(junit, cases)
    if as_json:
        typer.echo(json.dumps([_content(case) for case in cases]))
    else:
        print_cases(cases)
    if any(case.fails for case in cases):
        raise typer.Exit(1)


def _homes(
    homes: str | None, source: str, overrides: Sequence[str]
) -> Iterator[tuple[str, list[str]]]:
    """Yield the homes to run a scenario in: a name, and the change of the scenario.

    Raises:
        InputError: There are no such floor plans.
    """
    from fleet2d.scenario.load import load_scenario
    from fleet2d.studies.axes import FloorplansAxis, SyntheticAxis

    if homes is None:
        yield "", []
        return
    furnish = load_scenario(source, *overrides).resolved()["floorplan"].get("furnish")
    settings = {"furnish": furnish} if furnish else {}
    if homes.isdigit():
        axis = SyntheticAxis(synthetic=int(homes), settings=settings)
    else:
        axis = FloorplansAxis(floorplans=(homes,), settings=settings)  # type: ignore[assignment]
    for choice in axis.choices("home"):
        (_, section) = choice.changes[0]
        yield str(choice.labels["home"]), [f"floorplan={json.dumps(section)}"]


def _cases(
    source: str,
    overrides: Sequence[str],
    seeds: int,
    seed: int | None,
    home: str = "",
    *,
    strict: bool = False,
) -> Iterator[ScenarioCase]:
    """Yield a scenario with each of its seeds, after a check of its set-up.

    Raises:
        InputError: The scenario or an expectation is wrong, or it has no expectations.
    """
    from fleet2d.engine.simulation import Simulation
    from fleet2d.scenario.load import load_scenario

    scenario = load_scenario(source, *overrides)
    if not scenario.expect:
        raise InputError(
            f"{source} has no expectations: write, for example,\n"
            "  expect: {keeps_off: 'always(distance(ana, astro) > 0.5 m)'}"
        )
    if seed is None:
        seed = scenario.simulation.seed
    first_seed = FIRST_SEED if seed is None else seed
    if not home:  # of several homes, some may lack what it needs
        report_wrong(Simulation(scenario), strict=strict)
    for number in range(first_seed, first_seed + seeds):
        simulation = scenario.simulation.model_copy(update={"seed": number})
        yield ScenarioCase(
            source, scenario.model_copy(update={"simulation": simulation}), overrides, home
        )


def _run(case: ScenarioCase) -> None:
    """Run a case, and judge it."""
    import time

    from fleet2d.engine.simulation import Simulation

    start_s = time.perf_counter()
    try:
        simulation = Simulation(case.scenario)
        simulation.run()
        case.verdicts = simulation.verdicts()
    except Fleet2DError as error:
        case.error = str(error)
    case.wall_s = time.perf_counter() - start_s


def _store(case: ScenarioCase, pictures: Path | None, out: Path | None) -> None:
    """Run a failed case again, to store it and to draw the worst moments."""
    from fleet2d.engine.simulation import Simulation, evidence_of

    directory = None if out is None else out / case.name
    simulation = Simulation(case.scenario, out=directory)
    run = simulation.run()
    if directory is not None:
        case.files.append(directory)
    if pictures is None:
        return
    from fleet2d.viewing.figures import draw_failure

    pictures.mkdir(parents=True, exist_ok=True)
    for verdict in case.verdicts.values():
        worst = verdict.worst
        if worst is not None:
            path = pictures / f"{case.name}-{file_name(verdict.name)}.png"
            evidence = evidence_of(simulation, verdict.name)
            draw_failure(run, worst.worst, path, str(verdict), evidence)
            case.files.append(path)


def _content(case: ScenarioCase) -> dict[str, Any]:
    return {
        "scenario": case.source,
        "seed": case.seed,
        **({"home": case.home} if case.home else {}),
        "holds": not case.fails,
        "error": case.error or None,
        "wall_s": case.wall_s,
        "expectations": {name: verdict.content() for name, verdict in case.verdicts.items()},
        "files": [str(path) for path in case.files],
    }
