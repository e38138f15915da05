"""The pytest plugin: calls a test with a `trial` once for each run, and reports the decision.

pytest loads it by the entry point of the package; nothing else in Fleet2D imports pytest.
"""

import functools
import traceback
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from fleet2d.testing.claim import Claim
    from fleet2d.testing.trials import Body

PROPERTY = "fleet2d"
"""The property of a test that holds the decision, also in JUnit XML."""
TRIAL = "trial"
CLAIM = "fleet2d_claim"  # the attribute of a test function that holds its claim


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

    # pytest shows the lines of the test, but not those of its call to `fail`.
    __tracebackhide__ = _is_error
    claim = _with_options(claim, pyfuncitem.config)
    body = _body(pyfuncitem)
    problem = ""
    result = None
    try:
        claim.prepare()
        result = run_claim(claim, body)
    except Fleet2DError as error:
        problem = f"{_place_of(error, pyfuncitem.path)}{error}"
    if result is None:
        pytest.fail(problem, pytrace=False)
    pyfuncitem.user_properties.append((PROPERTY, result.text))
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


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print the decision on each test with several runs."""
    reports = (report for of_kind in terminalreporter.stats.values() for report in of_kind)
    calls = [report for report in reports if getattr(report, "when", None) == "call"]
    decided = [(report.nodeid, dict(report.user_properties).get(PROPERTY)) for report in calls]
    lines = [f"{test}: {text}" for test, text in decided if text not in (None, "held", "failed")]
    if lines:
        terminalreporter.section("trials")
        for line in sorted(lines):
            terminalreporter.line(line)
