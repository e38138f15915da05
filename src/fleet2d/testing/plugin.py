"""The pytest plugin: calls a test with a `trial` once for each run, and reports the decision.

pytest loads it by the entry point of the package; nothing else in Fleet2D imports pytest.
"""

import functools
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from fleet2d.testing.claim import Claim
    from fleet2d.testing.gate import Gate
    from fleet2d.testing.suite import TrialReport
    from fleet2d.testing.trials import Body, ClaimResult

PROPERTY = "fleet2d"
"""The property of a test that holds the decision, also in JUnit XML."""
TRIAL = "trial"
CLAIM = "fleet2d_claim"  # the attribute of a test function that holds its claim
DECISION = "fleet2d"
"""The attribute of a report of a test that holds its trials as plain data, for other processes."""
KEPT = pytest.StashKey[dict[str, Any]]()
OUTCOMES = ("passed", "failed", "error", "skipped", "xfailed", "xpassed")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("fleet2d", "Fleet2D: tests of robots in simulated homes")
    group.addoption(
        "--fleet2d-artifacts",
        metavar="DIR",
        type=Path,
        help="where runs and pictures of failures go; left out: the cache of pytest",
    )
    group.addoption(
        "--fleet2d-seed",
        metavar="SEED",
        type=int,
        help="run each trial with this seed alone, to see it again",
    )
    group.addoption(
        "--fleet2d-scenario",
        metavar="FILE",
        help="run each trial in this scenario alone, such as one that `fleet2d falsify` wrote",
    )
    group.addoption(
        "--fleet2d-set",
        metavar="KEY.PATH=VALUE",
        action="append",
        default=[],
        help="change the scenario of each trial, such as its robot; again for more",
    )
    group.addoption(
        "--fleet2d-requirements",
        metavar="FILE",
        type=Path,
        help="a YAML file of requirements, ids and texts: those that no test covers are named",
    )
    group.addoption(
        "--fleet2d-shrink",
        metavar="RUNS",
        type=int,
        default=40,
        help="how many runs may be spent to make a failure smaller; 0: none",
    )


@pytest.fixture
def trial() -> None:
    """Placeholder; @fleet2d.testing.trial supplies the real trial in each run."""


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Call a test with a claim once for each run, until the claim is decided."""
    claim = getattr(pyfuncitem.obj, CLAIM, None)
    if claim is None:
        fixtures = pyfuncitem._fixtureinfo.name2fixturedefs.get(TRIAL) or ()
        if any(fixture.func.__module__ == __name__ for fixture in fixtures[-1:]):
            pytest.fail("a test with `trial` needs @fleet2d.testing.trial(…)", pytrace=False)
        return None
    from fleet2d.errors import Fleet2DError
    from fleet2d.testing.failures import explain
    from fleet2d.testing.trials import run_claim

    # Tracebacks of pytest then show the lines of the test, but not the calls to `fail` below.
    __tracebackhide__ = _is_error
    claim = _with_options(claim, pyfuncitem.config)
    body = _body(pyfuncitem)
    problem = ""
    result = None
    start_s = time.monotonic()
    try:
        claim.prepare()
        result = run_claim(claim, body)
    except Fleet2DError as error:
        problem = f"{_place_of(error, pyfuncitem.path)}{error}"
    if result is None:
        pytest.fail(problem, pytrace=False)
    pyfuncitem.user_properties.append((PROPERTY, result.text))
    pyfuncitem.stash[KEPT] = _decision(result, body, time.monotonic() - start_s)
    if not result.holds:
        tries = pyfuncitem.config.getoption("--fleet2d-shrink")
        text = explain(result, body, _folder(pyfuncitem), pyfuncitem.nodeid, tries)
        failure = result.shown.error
        if failure is None:
            pytest.fail(text, pytrace=False)
        failure.add_note(text)  # pytest shows the compared values
        raise failure
    return True


def _place_of(error: BaseException, path: Path) -> str:
    """Return the line of a test's file at which an error occurred, with its code."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename) == path]
    return f"{path.name}:{frames[-1].lineno}: {frames[-1].line}: " if frames else ""


def _is_error(info: Any) -> bool:
    return not info.errisinstance(pytest.fail.Exception)


def _with_options(claim: "Claim", config: pytest.Config) -> "Claim":
    """Return a claim with the options of the command line applied."""
    scenario = config.getoption("--fleet2d-scenario")
    if scenario is not None:
        claim = claim.of_scenario(scenario)
    claim = replace(claim, overrides=(*claim.overrides, *config.getoption("--fleet2d-set")))
    return replace(claim, only=config.getoption("--fleet2d-seed"))


def _body(item: pytest.Function) -> "Body":
    """Return the test with all fixtures bound except the trial."""
    names = item._fixtureinfo.argnames
    if TRIAL not in names:
        pytest.fail("@fleet2d.testing.trial needs a test with an argument `trial`", pytrace=False)
    arguments = {name: item.funcargs[name] for name in names if name != TRIAL}
    function = item.obj

    @functools.wraps(function)
    def body(trial: Any) -> Any:
        __tracebackhide__ = True
        return function(trial=trial, **arguments)

    return body


def _folder(item: pytest.Function) -> Path:
    """Return the folder for the artifacts of a failing test."""
    folder = item.config.getoption("--fleet2d-artifacts")
    cache = getattr(item.config, "cache", None)
    if folder is None and cache is not None:
        folder = cache.mkdir("fleet2d")
    return Path(folder or ".fleet2d")


def _decision(result: "ClaimResult", body: "Body", wall_s: float) -> dict[str, Any]:
    """Return the outcome of a claim as plain data."""
    from fleet2d.testing.suite import key_of, outcomes_of

    rate = result.claim.rate
    trials = []
    for trial in result.trials:
        _, home, seed = key_of("", trial.variant)
        outcomes = outcomes_of(trial, body, may_be_untested=result.claim.may_be_untested)
        plain = [asdict(replace(each, content={})) for each in outcomes]
        trials.append([home, seed, plain, trial.simulated_s])
    claim = [rate.seeds, rate.holds, rate.error]
    return {"trials": trials, "accepted": result.holds, "claim": claim, "wall_s": wall_s}


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: "pytest.CallInfo[None]") -> Iterator[None]:
    """Add the outcome of a test's claim to its report."""
    outcome = yield
    if call.when != "teardown" and hasattr(getattr(item, "obj", None), CLAIM):
        setattr(outcome.get_result(), DECISION, item.stash.get(KEPT, {}))  # type: ignore[attr-defined]


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print the answer of the tests with trials, if there are any."""
    reports = {}
    for outcome in OUTCOMES:
        for report in terminalreporter.stats.get(outcome, ()):
            if hasattr(report, DECISION):
                reports[report.nodeid] = outcome, report
    if reports:
        from fleet2d.errors import InputError
        from fleet2d.testing.answer import answer

        terminalreporter.section("what the trials show")
        try:
            terminalreporter.line(str(answer(_gate(reports, config))))
        except InputError as error:  # the requirements are wrong
            terminalreporter.line(f"error: {error}")


def _gate(reports: dict[str, tuple[str, Any]], config: pytest.Config) -> "Gate":
    """Return the gate of the tests of a session, which have no build.

    Raises:
        InputError: The requirements can't be read, or lack one that a test covers.
    """
    from fleet2d.configuration.problems import counted
    from fleet2d.testing.answer import cost_of
    from fleet2d.testing.claim import rate_test
    from fleet2d.testing.gate import Gate, Tally, cover, read_requirement_list, tallies_of
    from fleet2d.testing.suite import TrialKey, TrialReport

    tallies: list[Tally] = []
    notes: list[str] = []
    skipped: Counter[str] = Counter()
    every: list[TrialReport] = []
    wall_s = 0.0
    for test, (outcome, report) in reports.items():
        decision = getattr(report, DECISION)
        if outcome == "skipped":
            skipped[_reason(report)] += 1
        elif not decision:
            broken = TrialReport(TrialKey(test, "", 0), error=_reason(report))
            tallies += tallies_of(test, [broken], None, None)
        else:
            trials = _trials(test, decision)
            claim = rate_test(*decision["claim"])
            tallies += tallies_of(test, trials, decision["accepted"], claim)
            every += trials
            wall_s += decision["wall_s"]
            if decision["accepted"] and outcome in ("xpassed", "failed"):
                notes.append(f"{test} held, though it is expected to fail")
    notes += [f"{counted(number, 'test')} skipped: {why}" for why, number in skipped.items()]
    path = config.getoption("--fleet2d-requirements")
    requirements = None if path is None else read_requirement_list(path)
    return Gate(
        "",
        tallies,
        coverage=cover(tallies, requirements),
        notes=notes,
        cost=cost_of(every, wall_s),
        expected=frozenset(test for test, (outcome, _) in reports.items() if outcome == "xfailed"),
    )


def _trials(test: str, decision: dict[str, Any]) -> "list[TrialReport]":
    """Return the trials of a test from plain data."""
    from fleet2d.testing.suite import TrialKey, TrialOutcome, TrialReport

    found = []
    for home, seed, plain, simulated_s in decision["trials"]:
        outcomes = tuple(TrialOutcome(**{**p, "covers": tuple(p["covers"])}) for p in plain)
        key = TrialKey(test, home, seed)
        found.append(TrialReport(key, outcomes, simulated_s=simulated_s))
    return found


def _reason(report: Any) -> str:
    """Return why a test was skipped or couldn't be run, in one line."""
    text = report.longrepr
    if isinstance(text, tuple):  # a skipped test has file, line and reason
        return str(text[2]).removeprefix("Skipped: ")
    crash = getattr(text, "reprcrash", None)
    message = str(text if crash is None else crash.message).removeprefix("Failed: ")
    return message.strip().partition("\n")[0]
