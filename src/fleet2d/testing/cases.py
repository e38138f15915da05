"""`fleet2d test`: run tests of one build, or of two on the same trials, and say what they show."""

import json
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from fleet2d.cli.run import Strict
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.options import Workers

if TYPE_CHECKING:
    from fleet2d.testing.gate import Gate, Tally
    from fleet2d.testing.history import VerdictHistory
    from fleet2d.testing.suite import Build, SuiteTest, TrialKey, TrialReport

MAX_STORED = 5
"""Maximum number of failing trials of an expectation that are stored and drawn."""
FAILURES = "failures"
"""The folder for runs in the commands that are printed."""


def test(  # noqa: PLR0913 - options of the command line
    arguments: Annotated[
        list[str],
        typer.Argument(
            metavar="TEST|KEY.PATH=VALUE",
            help="Scenarios with expectations, Python tests, folders of these, and changes to all.",
        ),
    ],
    seeds: Annotated[int | None, typer.Option(min=1, help="The number of seeds of each.")] = None,
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
    build: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE.yaml", help="The build: its name, or settings laid over each test."
        ),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE.yaml",
            help="Compare with another build on the same trials: its settings, or its name in the"
            " history.",
        ),
    ] = None,
    requirements: Annotated[
        Path | None, typer.Option(help="A YAML file of requirements: ids and texts.")
    ] = None,
    history: Annotated[
        Path | None, typer.Option(help="An SQLite file of verdicts by build, which it adds to.")
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(metavar="N|TIME", help="Run so many trials at most, or for '10 min'."),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="One HTML file to write, to send.")] = None,
    junit: Annotated[Path | None, typer.Option(help="JUnit XML to write.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for runs that fail, and pictures of the moments.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    strict: Strict = False,
    workers: Workers = None,
) -> None:
    """Run tests, and say whether their build is fit for release.

    The exit code is 1 if an expectation is violated; with --against, if it is clearly worse than
    with that build, or fails only now.

    Examples:
      fleet2d test home.yaml --seeds 20
      fleet2d test tests/ --build new.yaml --against old.yaml --seeds 20 --report gate.html
    """
    from fleet2d.testing.suite import check_set_up, collect

    texts = [argument for argument in arguments if "=" not in argument]
    overrides = [argument for argument in arguments if "=" in argument]
    if not texts:
        raise InputError("name the scenarios to test: fleet2d test SCENARIO.yaml…")
    tests, notes = collect(texts, overrides, seeds, seed, homes)
    check_set_up(tests, strict=strict)
    suite = _Suite(tests, notes, workers, show=not as_json)
    suite.read(build, against, history, budget, requirements)
    suite.run()
    gate = suite.gate()
    with ExitStack() as stack:
        folder = out
        if report is not None and out is None:
            folder = Path(stack.enter_context(TemporaryDirectory()))
        if folder is not None:
            suite.store(gate, folder, MAX_STORED if out is not None else 1)
        hints = {each: suite.hint(gate, each, out) for each in [*gate.blocking, *gate.known]}
        if report is not None:
            from fleet2d.testing.report import write_report

            write_report(report, gate, hints, suite.pictures)
    if junit is not None:
        from fleet2d.testing.junit import write_junit

        write_junit(junit, gate, suite.times_s, hints)
    if as_json:
        from fleet2d.testing.answer import answer, headline

        first = {"verdict": headline(gate), "answer": answer(gate).content}
        typer.echo(json.dumps({**first, **gate.content(), "trials": suite.content()}))
    else:
        _print(gate, hints, suite.files if out is not None else {})
    if not gate.passes:
        raise typer.Exit(1)


@dataclass
class _Suite:
    """The tests of a command, the options of their trials, and the reports."""

    tests: "list[SuiteTest]"
    notes: list[str]
    workers: int | None
    show: bool
    builds: "list[Build]" = field(default_factory=list)
    against: str = ""
    history: "VerdictHistory | None" = None
    requirements: dict[str, str] | None = None
    numbers: dict[str, list[int]] = field(default_factory=dict)
    keys: "dict[str, list[TrialKey]]" = field(default_factory=dict)
    reports: "list[list[TrialReport]]" = field(default_factory=list)
    earlier: "list[TrialReport]" = field(default_factory=list)
    files: "dict[TrialKey, list[Path]]" = field(default_factory=dict)
    pictures: "dict[Tally, Path]" = field(default_factory=dict)
    prints: dict[str, str] = field(default_factory=dict)
    wall_s: float = 0.0

    def read(
        self,
        build: str | None,
        against: str | None,
        history: Path | None,
        budget: str | None,
        requirements: Path | None,
    ) -> None:
        """Read the options, before anything is run.

        Raises:
            InputError: One of them is wrong.
        """
        from fleet2d.testing.gate import read_requirement_list
        from fleet2d.testing.history import VerdictHistory, fingerprints_of

        if history is not None and build is None:
            raise InputError("--history: name the build whose verdicts are added: --build NAME")
        if requirements is not None:
            self.requirements = read_requirement_list(requirements)
        self.keys = {test.name: test.keys() for test in self.tests}
        self.builds = [_build_of(build or "")]
        if history is not None:
            self.history = VerdictHistory(history)
            self.prints = fingerprints_of(self.tests)
        if against is not None:
            self._read_other(against)
        self._plan(budget)

    def _read_other(self, against: str) -> None:
        other = _build_of(against)
        if other.overlay is None and self.history is None:
            raise InputError(
                f"--against {against}: expected a YAML file of settings, or the name of a build in"
                " the --history"
            )
        if other.name == self.builds[0].name:
            raise InputError(f"--against: both builds are named {other.name}: rename a file")
        self.against = other.name
        if other.overlay is not None:
            self.builds.append(other)
        elif self.history is not None:
            self.earlier = self.history.reports(other.name, self.prints)

    def _plan(self, budget: str | None) -> None:
        """Choose the trials to run."""
        from fleet2d.studies.executors import cores
        from fleet2d.testing.command import parse_budget
        from fleet2d.testing.history import plan

        sizes = {name: len(keys) for name, keys in self.keys.items()}
        counts = sizes
        if budget is not None:
            past = {} if self.history is None else self.history.past()
            workers = self.workers or cores()
            tries, seconds = parse_budget(budget)
            counts, notes = plan(sizes, past, tries, seconds, len(self.builds), workers)
            self.notes += notes
        for test in self.tests:
            order = list(range(sizes[test.name]))
            if not test.function:  # all homes with the first seed come before any with the next
                each = len(test.seeds)
                order = [number for first in range(each) for number in order[first::each]]
            self.numbers[test.name] = sorted(order[: counts[test.name]])

    def run(self) -> None:
        """Run all trials, and add them to the history."""
        from fleet2d.testing.suite import run_suite

        start_s = time.monotonic()
        self.reports = run_suite(
            self.tests, self.builds, self.keys, self.numbers, workers=self.workers, show=self.show
        )
        self.wall_s = time.monotonic() - start_s
        if self.history is not None:
            for build, reports in reversed([*zip(self.builds, self.reports, strict=True)]):
                self.history.add(build.name, self.prints, reports)

    def gate(self) -> "Gate":
        """Return the gate of the trials."""
        from fleet2d.testing.answer import cost_of
        from fleet2d.testing.gate import Gate, compare, cover, tally

        reports = [report for of_build in self.reports for report in of_build]
        tallies = tally(self.tests, self.reports[0])
        other = self.reports[1] if len(self.reports) > 1 else self.earlier
        before = tally(self.tests, other) if self.against else []
        return Gate(
            self.builds[0].name,
            tallies,
            self.against,
            before,
            compare(tallies, before),
            cover(tallies, self.requirements),
            {} if self.history is None else self.history.trend(),
            self.notes,
            cost_of(reports, self.wall_s, len(self.builds)),
        )

    def store(self, gate: "Gate", folder: Path, most: int) -> None:
        """Run the worst failing trials again, to store them and to draw their moments.

        Args:
            gate: The gate.
            folder: Where runs and pictures are stored.
            most: The largest number of trials of each expectation.
        """
        from fleet2d.testing.suite import SuiteJob, SuiteTask, run_name

        job = SuiteJob(tuple(self.tests), tuple(self.builds))
        failing = [each for each in [*gate.blocking, *gate.known] if each.outcomes]
        for each, key in [(t, k) for t in failing for k in _trials_to_show(gate, t)[:most]]:
            if key in self.files:
                continue
            names = [test.name for test in self.tests]
            trial = self.keys[each.test].index(key)
            task = SuiteTask(0, 0, "", "", key, names.index(each.test), 0, trial)
            directory = folder / run_name(key)
            try:
                result = job.run(task, directory)
            except Fleet2DError as error:
                self.notes.append(f"{directory} was not stored: {error}")
                continue
            self.files[key] = [directory]
            evidence = {r.name: r.evidence for r in result.results}
            for other in failing:
                if key in _trials_to_show(gate, other)[:most]:
                    self._draw(other, key, directory, evidence.get(other.name))

    def _draw(self, each: "Tally", key: "TrialKey", directory: Path, evidence: object) -> None:
        """Draw the worst moment of a failure beside its run."""
        from fleet2d.options import file_name

        outcome = each.outcomes[key]
        if outcome.step is None:
            return
        picture = directory.with_name(f"{directory.name}-{file_name(outcome.name)}.png")
        try:
            from fleet2d.runs.run import open_run
            from fleet2d.viewing.figures import draw_failure

            draw_failure(open_run(directory), outcome.step, picture, outcome.says, evidence)  # type: ignore[arg-type]
        except Fleet2DError as error:  # matplotlib may be missing
            self.notes.append(f"{picture.name} was not drawn: {error}")
            return
        self.files[key].append(picture)
        self.pictures.setdefault(each, picture)

    def hint(self, gate: "Gate", each: "Tally", out: Path | None) -> str:
        """Return the commands that show a failure."""
        from fleet2d.testing.suite import run_name

        key = next(iter(_trials_to_show(gate, each)), None)
        if key is None:
            return ""
        test = next(test for test in self.tests if test.name == each.test)
        outcome = each.outcomes.get(key)
        at = ""
        if outcome is not None and outcome.step is not None:
            at = f" --at 'step {outcome.step}'"
        if out is not None and key in self.files:
            return f"see it: fleet2d show {self.files[key][0]}{at}"
        run = test.command(key, self.builds[0], FAILURES)
        if outcome is None:  # a trial that can't be run stores nothing
            return f"again: {run}"
        return f"see it: {run}; fleet2d show {FAILURES}/{run_name(key)}{at}"

    @property
    def times_s(self) -> Mapping[str, float]:
        """The wall time of each test [s]."""
        times_s: Counter[str] = Counter()
        for report in self.reports[0]:
            times_s[report.key.test] += report.wall_s  # type: ignore[assignment]
        return times_s

    def content(self) -> list[dict[str, object]]:
        """Return the trials as plain JSON data."""
        return [
            self._trial_content(build.name, report)
            for build, reports in zip(self.builds, self.reports, strict=True)
            for report in reports
        ]

    def _trial_content(self, build: str, report: "TrialReport") -> dict[str, object]:
        """Return a trial of a build as plain JSON data."""
        key = report.key
        return {
            "test": key.test,
            "build": build,
            "seed": key.seed,
            **({"home": key.home} if key.home else {}),
            "holds": report.holds,
            "error": report.error or None,
            "wall_s": report.wall_s,
            "expectations": {outcome.name: outcome.content for outcome in report.outcomes},
            "files": [str(path) for path in self.files.get(key, ())],
        }


def _build_of(text: str) -> "Build":
    """Return the build of an option: a file of settings, or only a name.

    Raises:
        InputError: There is no such file.
    """
    from fleet2d.testing.suite import SUFFIXES, Build

    path = Path(text)
    if path.suffix not in SUFFIXES:
        return Build(text)
    if not path.is_file():
        raise InputError(f"there is no {path}: a build is a YAML file of settings, or a name")
    return Build(path.stem, path)


def _trials_to_show(gate: "Gate", each: "Tally") -> "list[TrialKey]":
    """Return the trials that show a failure, the worst first; those that got worse come first."""
    change = gate.change_of.get(each.place)
    worse = set(change.worse) if change is not None else set()
    failed = each.failed or [report.key for report in each.errors]
    return sorted(failed, key=lambda key: key not in worse)


def _print(
    gate: "Gate", hints: "Mapping[Tally, str]", files: "Mapping[TrialKey, list[Path]]"
) -> None:
    """Print what failed and how to see it, and the answer."""
    from fleet2d.testing.answer import answer

    outcomes = [o for each in gate.tallies for o in each.outcomes.values()]
    notes = dict.fromkeys(note for o in outcomes for note in o.content.get("notes", ()))
    lines = [f"note: {note}" for note in notes]
    lines += gate.details(hints)
    lines += [f"stored: {path}" for paths in files.values() for path in paths]
    for line in [*lines, ""] if lines else []:
        typer.echo(line)
    typer.echo(answer(gate))
