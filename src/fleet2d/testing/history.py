"""The history of verdicts: an SQLite file with the outcomes of the trials of each build."""

import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from fleet2d.configuration.problems import suggest
from fleet2d.errors import InputError
from fleet2d.testing.gate import Place
from fleet2d.testing.suite import SuiteTest, TrialKey, TrialOutcome, TrialReport

APPLICATION = 0xF1EE72D
"""The application id that tells a history from other SQLite files."""
VERSION = 1
WAIT_S = 5.0
"""How long another program may hold the file [s]."""
TABLES = """
CREATE TABLE builds (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, added TEXT NOT NULL);
CREATE TABLE trials (
    id INTEGER PRIMARY KEY, build INTEGER NOT NULL REFERENCES builds, test TEXT NOT NULL,
    fingerprint TEXT NOT NULL, home TEXT NOT NULL, seed INTEGER NOT NULL, error TEXT NOT NULL,
    wall_s REAL NOT NULL, UNIQUE (build, test, home, seed));
CREATE TABLE verdicts (
    trial INTEGER NOT NULL REFERENCES trials ON DELETE CASCADE, expectation TEXT NOT NULL,
    holds INTEGER, fails INTEGER NOT NULL, margin REAL, unit TEXT NOT NULL, says TEXT NOT NULL,
    PRIMARY KEY (trial, expectation));
"""


class PastTrials(NamedTuple):
    """The past trials of a test, by the history.

    Attributes:
        trials: The number of its trials.
        failed: How many of them failed.
        wall_s: Mean wall time of a trial [s].
    """

    trials: int
    failed: int
    wall_s: float


class VerdictHistory:
    """A file of verdicts by build; it is made when the first are added.

    Args:
        path: The file.

    Raises:
        InputError: The file is no history, of another version, or in use.

    Example:
        >>> import tempfile
        >>> history = VerdictHistory(Path(tempfile.mkdtemp()) / "history.db")
        >>> history.add("1.0", {"a.yaml": "f00"}, [TrialReport(TrialKey("a.yaml", "", 3))])
        >>> history.builds, len(history.reports("1.0", {"a.yaml": "f00"}))
        (['1.0'], 1)
    """

    def __init__(self, path: Path) -> None:
        """Check the file."""
        self.path = path
        with self._open() as file:
            version = file.execute("PRAGMA user_version").fetchone()[0]
            is_ours = file.execute("PRAGMA application_id").fetchone()[0] == APPLICATION
            is_empty = not file.execute("SELECT 1 FROM sqlite_master").fetchall()
            if not is_empty and not is_ours:
                raise InputError(f"{path} is no history of tests: name another file by --history")
            if is_ours and version != VERSION:
                raise InputError(
                    f"{path} is of version {version} of a history, and this is version {VERSION}:"
                    " name a new file by --history"
                )

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        """Yield a connection, whose changes are written at the end of the context, or not at all.

        Raises:
            InputError: The file can't be used.
        """
        try:
            with closing(sqlite3.connect(self.path, timeout=WAIT_S)) as file, file:
                file.execute("PRAGMA foreign_keys = ON")
                yield file
        except sqlite3.Error as error:
            advice = "; another program uses it: try again later" if "locked" in str(error) else ""
            raise InputError(f"--history {self.path} can't be used: {error}{advice}") from error

    @property
    def builds(self) -> list[str]:
        """The names of its builds, in the order in which they were added."""
        return [name for (name,) in self._rows("SELECT name FROM builds ORDER BY id")]

    def add(
        self, build: str, fingerprints: Mapping[str, str], reports: Sequence[TrialReport]
    ) -> None:
        """Add the trials of a build, in place of older ones of the same test, home and seed.

        Args:
            build: The name of the build.
            fingerprints: The digest of each test.
            reports: The trials.

        Raises:
            InputError: The file can't be written.
        """
        with self._open() as file:
            if not file.execute("SELECT 1 FROM sqlite_master").fetchall():
                file.executescript(TABLES)
                file.execute(f"PRAGMA application_id = {APPLICATION}")
                file.execute(f"PRAGMA user_version = {VERSION}")
            file.execute("BEGIN IMMEDIATE")
            now = datetime.now(UTC).isoformat(timespec="seconds")
            file.execute("INSERT OR IGNORE INTO builds (name, added) VALUES (?, ?)", (build, now))
            (number,) = file.execute("SELECT id FROM builds WHERE name = ?", (build,)).fetchone()
            for report in reports:
                key = report.key
                place = number, key.test, key.home, key.seed
                same = "build = ? AND test = ? AND home = ? AND seed = ?"
                file.execute(f"DELETE FROM trials WHERE {same}", place)  # noqa: S608
                row = file.execute(
                    "INSERT INTO trials (build, test, home, seed, fingerprint, error, wall_s)"
                    " VALUES (?, ?, ?, ?, ?, ?, ?)",
                    (*place, fingerprints[key.test], report.error, report.wall_s),
                )
                verdicts = [
                    (row.lastrowid, o.name, o.holds, o.fails, o.margin, o.unit, o.says)
                    for o in report.outcomes
                ]
                file.executemany("INSERT INTO verdicts VALUES (?, ?, ?, ?, ?, ?, ?)", verdicts)

    def reports(self, build: str, fingerprints: Mapping[str, str]) -> list[TrialReport]:
        """Return the trials of a build of tests that haven't changed since.

        Args:
            build: The name of the build.
            fingerprints: The present digest of each test.

        Raises:
            InputError: There is no such build, or the file can't be read.
        """
        if build not in self.builds:
            raise InputError(f"{self.path} has no build {build!r}{suggest(build, self.builds)}")
        query = (
            "SELECT trials.id, test, home, seed, fingerprint, error, wall_s FROM trials"
            " JOIN builds ON builds.id = build WHERE name = ? ORDER BY trials.id"
        )
        outcomes: dict[int, list[TrialOutcome]] = {}
        for trial, name, holds, fails, margin, unit, says in self._rows("SELECT * FROM verdicts"):
            held = None if holds is None else bool(holds)
            outcome = TrialOutcome(name, held, bool(fails), says, margin, unit)
            outcomes.setdefault(trial, []).append(outcome)
        reports = []
        for number, test, home, seed, fingerprint, error, wall_s in self._rows(query, build):
            if fingerprints.get(test) == fingerprint:
                key = TrialKey(test, home, seed)
                reports.append(TrialReport(key, tuple(outcomes.get(number, ())), error, wall_s))
        return reports

    def trend(self) -> dict[str, dict[Place, tuple[int, int]]]:
        """Return for each build how often each expectation held, and in how many trials."""
        query = (
            "SELECT builds.name, test, expectation, SUM(holds IS 1), COUNT(*) FROM verdicts"
            " JOIN trials ON trials.id = trial JOIN builds ON builds.id = build"
            " GROUP BY builds.id, test, expectation ORDER BY builds.id, test, expectation"
        )
        found: dict[str, dict[Place, tuple[int, int]]] = {build: {} for build in self.builds}
        for build, test, expectation, held, number in self._rows(query):
            found[build][test, expectation] = held, number
        return found

    def past(self) -> dict[str, PastTrials]:
        """Return the past trials of each test, by its name."""
        query = (
            "SELECT test, COUNT(*), SUM(error != '' OR EXISTS (SELECT 1 FROM verdicts"
            " WHERE trial = trials.id AND fails)), "
            " COALESCE(AVG(CASE error WHEN '' THEN wall_s END), 0) FROM trials GROUP BY test"
        )
        return {test: PastTrials(*row) for test, *row in self._rows(query)}

    def _rows(self, query: str, *values: object) -> list[tuple[Any, ...]]:
        with self._open() as file:
            if not file.execute("SELECT 1 FROM sqlite_master").fetchall():
                return []
            return file.execute(query, values).fetchall()


def plan(
    sizes: Mapping[str, int],
    past: Mapping[str, PastTrials],
    tries: int,
    seconds: float | None,
    builds: int = 1,
    workers: int = 1,
) -> tuple[dict[str, int], list[str]]:
    """Return how many trials of each test to run within a budget, and notes on tests left out.

    The next trial is always of the test from which most is learned in its time: that whose share of
    failures is most uncertain, by past verdicts and the number of trials planned so far. Each test
    gets one trial before any gets a second.

    Args:
        sizes: The number of trials of each test, by its name.
        past: The past trials of tests, by name.
        tries: The largest number of runs.
        seconds: The wall time for them; None: any.
        builds: The number of builds that are run on each trial.
        workers: The number of processes.

    Raises:
        InputError: Nothing fits, or how long trials take isn't known.

    Example:
        >>> past = {"sure": PastTrials(50, 0, 1.0), "unsure": PastTrials(50, 20, 1.0)}
        >>> plan({"sure": 20, "unsure": 20}, past, 10**6, 12.0)[0]
        {'sure': 2, 'unsure': 10}
    """
    if seconds is not None and not any(test in past for test in sizes):
        raise InputError(
            "--budget: how long trials take isn't known yet: name the --history of an earlier run,"
            " or give a number of runs"
        )
    known = sorted(past[test].wall_s for test in sizes if test in past)
    usual_s = known[len(known) // 2] if known else 0.0
    cost_s = {t: builds * (past[t].wall_s if t in past else usual_s) for t in sizes}
    left_s = None if seconds is None else seconds * workers
    left = tries // builds
    counts = dict.fromkeys(sizes, 0)
    while left:
        fitting = [
            test for test, size in sizes.items()
            if counts[test] < size and (left_s is None or cost_s[test] <= left_s)
        ]  # fmt: skip
        if not fitting:
            break
        test = max(fitting, key=lambda test: _gain(counts[test], past.get(test), cost_s[test]))
        counts[test] += 1
        left -= 1
        left_s = left_s if left_s is None else left_s - cost_s[test]
    if not any(counts.values()):
        shortest = f" the shortest takes {min(cost_s.values()):.1f} s" if seconds else ""
        raise InputError(f"--budget: not one trial fits;{shortest or ' give more runs'}")
    notes = [
        f"left out by the budget: {size - counts[test]} of {size} trials of {test}"
        for test, size in sizes.items()
        if counts[test] < size
    ]
    return counts, notes


def _gain(count: int, past: PastTrials | None, cost_s: float) -> tuple[bool, float]:
    """Return the sort key of a test: whether no trial is planned yet, and the gain of one a second.

    The gain is the decrease of the variance of the share of failures, which past trials put at
    about (failed + 1/2) / (trials + 1).
    """
    failed, trials = (past.failed, past.trials) if past is not None else (0, 0)
    share = (failed + 0.5) / (trials + 1)
    gain = share * (1 - share) / max(1, count * (count + 1))
    return count == 0, gain / max(cost_s, 1e-3)


def fingerprints_of(tests: Sequence[SuiteTest]) -> dict[str, str]:
    """Return the digest of each test, by its name."""
    return {test.name: test.fingerprint() for test in tests}
