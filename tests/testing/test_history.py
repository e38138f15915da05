"""The history of verdicts, and the budget that is planned by it."""

import sqlite3
from pathlib import Path

import pytest
from tests.testing.test_cases import FAILS, HOLDS, written

from fleet2d.errors import InputError
from fleet2d.testing.history import PastTrials, VerdictHistory, plan
from fleet2d.testing.suite import TrialKey, TrialOutcome, TrialReport

PRINTS = {"home.yaml": "f00"}


def report(seed, *, fails=False, wall_s=1.0) -> TrialReport:
    outcome = TrialOutcome("still", not fails, fails, "it moved", 0.5, "m")
    return TrialReport(TrialKey("home.yaml", "", seed), (outcome,), "", wall_s)


def test_what_is_added_is_read_again_and_newer_trials_replace_older(tmp_path):
    history = VerdictHistory(tmp_path / "history.db")
    history.add("2.0", PRINTS, [report(1), report(2, fails=True)])
    history.add("2.1", PRINTS, [report(1)])
    history.add("2.0", PRINTS, [report(2)])

    assert ["2.0", "2.1"] == history.builds
    assert [report(1), report(2)] == history.reports("2.0", PRINTS)
    place = ("home.yaml", "still")
    assert {"2.0": {place: (2, 2)}, "2.1": {place: (1, 1)}} == history.trend()
    assert {"home.yaml": PastTrials(3, 0, 1.0)} == history.past()


def test_trials_of_a_test_that_has_changed_are_not_compared(tmp_path):
    history = VerdictHistory(tmp_path / "history.db")
    history.add("2.0", PRINTS, [report(1)])

    assert [] == history.reports("2.0", {"home.yaml": "other"})
    with pytest.raises(InputError, match=r"has no build '2.O': did you mean '2.0'"):
        history.reports("2.O", PRINTS)


def garbage(path: Path):
    path.write_bytes(b"no database at all, but long enough to be read as one" * 40)


def foreign(path: Path):
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE births (name TEXT)")


def newer(path: Path):
    VerdictHistory(path).add("2.0", PRINTS, [report(1)])
    with sqlite3.connect(path) as file:
        file.execute("PRAGMA user_version = 7")


def locked(path: Path):
    VerdictHistory(path).add("2.0", PRINTS, [report(1)])
    file = sqlite3.connect(path, check_same_thread=False)
    file.execute("BEGIN EXCLUSIVE")
    LOCKS.append(file)


LOCKS = []


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (garbage, "can't be used: file is not a database"),
        (foreign, "is no history of tests: name another file by --history"),
        (newer, "is of version 7 of a history, and this is version 1"),
        (locked, "another program uses it: try again later"),
        (Path.mkdir, "can't be used: unable to open"),
    ],
    ids=["garbage", "foreign", "newer", "locked", "a folder"],
)
def test_a_file_that_is_no_history_is_refused_before_anything_runs(
    fleet2d, monkeypatch, make, says
):
    monkeypatch.setattr("fleet2d.testing.history.WAIT_S", 0.1)
    make(Path("history.db"))
    code, out, err = fleet2d(
        "test", written(apart=HOLDS), "--history", "history.db", "--build", "2.1"
    )
    while LOCKS:
        LOCKS.pop().close()

    assert (code, out) == (2, "")
    assert says in err


def test_a_build_is_compared_with_one_of_the_history_and_its_trend_is_told(fleet2d):
    path = written(apart=HOLDS, still="never(speed(astro) > 1 m/s)")
    common = ("test", path, "--seeds", "6", "--history", "history.db")
    assert fleet2d(*common, "--build", "2.0")[0] == 0
    Path("2.1.yaml").write_text("robots: {astro: {speed: 2 m/s}}\n")
    code, out, _ = fleet2d(*common, "--build", "2.1.yaml", "--against", "2.0", "--report", "g.html")

    assert code == 1
    assert "compared with 2.0: worse in 6 of 6 trials (p = 0.062" in out
    assert "2.1 doesn't pass: 1 of 2 expectations is worse than with 2.0." in out
    page = Path("g.html").read_text()
    assert "<th>2.0</th><th>2.1</th>" in page
    assert '<td class="good">6 of 6</td><td class="bad">0 of 6</td>' in page


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--history", "history.db"], "name the build whose verdicts are added: --build NAME"),
        (["--against", "2.0"], "or the name of a build in the --history"),
        (["--against", "none.yaml"], "there is no none.yaml"),
        (["--budget", "10 min"], "how long trials take isn't known yet"),
        (["--requirements", "none.yaml"], "none.yaml"),
    ],
)
def test_options_that_cannot_be_followed_are_refused(fleet2d, options, says):
    code, out, err = fleet2d("test", written(apart=HOLDS), *options)

    assert (code, out) == (2, "")
    assert says in err


def test_a_build_that_does_not_start_is_told_from_a_test_that_is_wrong(fleet2d):
    Path("new.yaml").write_text("robots: {astro: {speeed: 2}}\n")
    code, out, _ = fleet2d("test", written(apart=HOLDS), "--build", "new.yaml")

    assert code == 1
    assert (
        "home.yaml can't be run in 1 of 1 trial, first in seed 4: new.yaml:1: robots.astro" in out
    )
    assert "new doesn't pass: 1 test can't be run." in out


def test_the_budget_prefers_what_is_unsure_and_cheap_and_says_what_it_leaves_out():
    past = {
        "sure": PastTrials(50, 0, 1.0),
        "unsure": PastTrials(50, 20, 1.0),
        "slow": PastTrials(50, 20, 8.0),
    }
    counts, notes = plan(dict.fromkeys(past, 20), past, 10**6, 30.0)

    assert counts["unsure"] > counts["sure"] >= 1
    assert counts["slow"] == 2
    assert "left out by the budget: 18 of 20 trials of slow" in notes
    assert sum(past[name].wall_s * count for name, count in counts.items()) <= 30
    assert (counts, notes) == plan(dict.fromkeys(past, 20), past, 10**6, 30.0)


def test_a_budget_in_which_nothing_fits_is_refused():
    with pytest.raises(InputError, match=r"not one trial fits; the shortest takes 8\.0 s"):
        plan({"slow": 20}, {"slow": PastTrials(5, 0, 8.0)}, 10**6, 3.0)
    with pytest.raises(InputError, match="not one trial fits; give more runs"):
        plan({"slow": 20}, {}, 1, None, builds=2)


def test_a_budget_of_runs_needs_no_history(fleet2d):
    written("home.yaml", apart=HOLDS)
    written("other.yaml", still=FAILS)
    code, out, _ = fleet2d("test", ".", "--seeds", "3", "--budget", "4")

    assert code == 1
    assert "left out by the budget: 1 of 3 trials of home.yaml" in out
    assert "It took 4 trials: " in out
