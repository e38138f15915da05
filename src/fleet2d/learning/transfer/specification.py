"""The file of a transfer experiment, and its cells: trainings, each tested in a home."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from pydantic import Field, ValidationError

from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import Document, read_document
from fleet2d.configuration.units import InputFileOrFolder
from fleet2d.errors import ScenarioError
from fleet2d.kernels import I64
from fleet2d.learning.fit.persona import FittedPersona, fit_persona
from fleet2d.learning.fit.timeline import Timeline, find_days, read_timeline
from fleet2d.learning.transfer.traces import (
    CLASSES,
    OTHER,
    OUT,
    MinuteTrace,
    trace_of_log,
)
from fleet2d.logs.layout import Layout, read_log
from fleet2d.logs.log import ActivityLog, LogError
from fleet2d.routines.persona import bundled_names
from fleet2d.scenario.load import explain
from fleet2d.studies.axes import AnyAxis

Task = Literal["room in 30 min", "room in 60 min", "room in 120 min", "activity", "presence"]
Arm = Literal["real", "own", "simulated", "tuned", "both", "fitted", "markov", "copied", "survey"]
ARMS: dict[str, str] = {
    "real": "other real homes, and the home's own days",
    "own": "the home's own days alone",
    "simulated": "people of the bundled personas",
    "tuned": "simulated, and then the home's own days",
    "both": "simulated and real",
    "fitted": "a persona fitted to the home's own days",
    "markov": "a Markov chain of the home's own days",
    "copied": "copies of the home's own days",
    "survey": "people of the time use survey",
}
"""The training data of each arm."""
WITHOUT_OWN = ("real", "simulated", "both", "survey")
WITH_OWN = ("real", "own", "tuned", "both", "fitted", "markov", "copied")
# The least number of days to which a persona is fitted.
FIT_DAYS = 3
Learner = Literal["usual", "regularised"]


class RealHome(Settings):
    """The log of one person in a real home.

    Attributes:
        path: The log, in any layout of rooms and activities, or its folder.
        format: Its layout; auto: recognized.
        id: The person, of a log with several.
        time_zone: The time zone of the home, if times have an offset.
        sort: Sort lines whose time runs backwards.
        rooms: The kind of room of labels, as {M003: bedroom}; empty text leaves them out.
        activities: The class of activities, as {Mahjong: leisure}.
    """

    path: InputFileOrFolder
    format: Layout = "auto"
    id: str | None = None
    time_zone: str | None = None
    sort: bool = False
    rooms: dict[str, str] = Field(default={})
    activities: dict[str, Literal[CLASSES]] = Field(default={})  # type: ignore[valid-type]

    def read(self) -> ActivityLog:
        """Read the log.

        Raises:
            LogError: The log can't be read, or is of positions.
        """
        log = read_log(self.path, self.format, id=self.id, time_zone=self.time_zone, sort=self.sort)
        if not isinstance(log, ActivityLog):
            raise LogError(f"{self.path} is a log of positions: give a log of rooms")
        return log


class TransferFile(Settings):
    """An experiment: models trained on real and simulated days, tested on real ones.

    Attributes:
        name: Its name.
        homes: The real homes by name.
        tasks: The targets of prediction.
        days: Numbers of days of a home that its models have.
        test_days: The least number of days that are left to test on.
        arms: The training data of models.
        learners: How; regularised: fewer and smaller trees, as a control.
        personas: The personas of simulated people: names or files; left out: all bundled ones.
        plans: The homes they live in, as axes of a study.
        lived_days: Days that each of them lives in each home.
        rows: The largest number of moments to learn from of others, and of simulated people.
        seed: The seed of all draws.
        skip: unfit: leave out and count what can't be trained or scored; left out: it is an error.
    """

    name: str | None = None
    homes: dict[str, RealHome] = Field(min_length=1)
    tasks: tuple[Task, ...] = Field(default=get_args(Task)[:4], min_length=1)
    days: tuple[int, ...] = Field(default=(0, 1, 3, 7, 14), min_length=1)
    test_days: int = Field(default=3, ge=1)
    arms: tuple[Arm, ...] = Field(default=get_args(Arm), min_length=1)
    learners: tuple[Learner, ...] = Field(default=get_args(Learner), min_length=1)
    personas: tuple[Any, ...] = ()
    plans: tuple[AnyAxis, ...] = Field(
        default=({"synthetic": 3, "settings": {"furnish": True}},), validate_default=True
    )
    lived_days: int = Field(default=14, ge=1)
    rows: int = Field(default=4000, ge=100)
    seed: int = Field(default=0, ge=0)
    skip: Literal["unfit"] | None = None

    def model_post_init(self, _: object, /) -> None:
        """Fill in the bundled personas."""
        if not self.personas:
            object.__setattr__(self, "personas", tuple(bundled_names()))


class Cell(NamedTuple):
    """A training, and its test in a home."""

    task: str
    learner: str
    home: str
    arm: str
    days: int


@dataclass(frozen=True)
class HomeEntry:
    """A real home with its log.

    Attributes:
        settings: Its settings.
        log: Its log.
        trace: Its minutes.
        timeline: Its days, from which personas are fitted.
    """

    settings: RealHome
    log: ActivityLog
    trace: MinuteTrace
    timeline: Timeline

    def own(self, days: int) -> I64:
        """Return the numbers of its first days that are known."""
        return self.trace.days[:days]

    def fitted(self, days: int) -> FittedPersona:
        """Return the persona fitted to its first days.

        Raises:
            LogError: No day has a known night before and after it.
        """
        first = int(self.trace.days[0])
        end = int(self.own(days)[-1]) + 1
        whole = self.timeline
        weekdays = whole.weekdays[first:end] if whole.weekdays else None
        part = Timeline(whole.states, whole.minutes[first:end], whole.seconds[first:end], weekdays)
        return fit_persona(part, find_days(part), f"fitted to {days} days")


@dataclass
class TransferPlan:
    """An experiment that is checked.

    Attributes:
        name: Its name.
        file: The settings.
        source: The file's text.
        homes: The homes that can be read.
        cells: The cells that can be trained and scored.
        tested: The days of each home that are tested on, the same for all of its cells.
        unfit: Why cells can't be trained or scored: a line each, with their number.
    """

    name: str
    file: TransferFile
    source: str = ""
    homes: dict[str, HomeEntry] = field(default_factory=dict)
    cells: list[Cell] = field(default_factory=list)
    tested: dict[str, I64] = field(default_factory=dict)
    unfit: dict[str, int] = field(default_factory=dict)


def read_plan(path: Path) -> TransferPlan:
    """Read a file and all of its logs, and find the cells that can be trained and scored.

    Raises:
        ScenarioError: The file is wrong, or cells can't be trained and `skip` is left out: one
            message names all homes.
    """
    document: Document = read_document(path)
    try:
        file = TransferFile.model_validate(document.data)
    except ValidationError as error:
        raise explain(error, document) from None
    plan = TransferPlan(file.name or path.stem, file, path.read_text(encoding="utf-8"))
    for name, settings in file.homes.items():
        try:
            plan.homes[name] = _read_home(settings)
        except LogError as error:
            count = sum(1 for _ in _cells(file, name))
            plan.unfit[f"{name}: {error}"] = count
    for name, home in plan.homes.items():
        _add_cells(plan, name, home)
    plan.cells.sort(key=lambda cell: file.tasks.index(cell.task))  # task by task
    if plan.unfit and file.skip is None:
        lines = [f"{words} ({count} cells)" for words, count in plan.unfit.items()]
        head = "some models can't be trained or scored; `skip: unfit` leaves them out and counts"
        raise ScenarioError("\n".join([head, *lines]))
    if not plan.cells:
        raise ScenarioError("\n".join(["no model can be trained and scored", *plan.unfit]))
    return plan


def _read_home(settings: RealHome) -> HomeEntry:
    """Read the log of a home.

    Raises:
        LogError: The log can't be read, or has neither places nor times.
    """
    log = settings.read()
    trace = trace_of_log(log, settings.rooms, settings.activities)
    if set(trace.rooms.tolist()) <= {-1, OUT, OTHER}:
        labels = ", ".join(sorted(log.rooms)[:5])
        raise LogError(
            f"its labels ({labels}) name no kind of room: say which they are, as in rooms:"
            " {M003: bedroom}"
        )
    return HomeEntry(settings, log, trace, read_timeline(log, settings.rooms))


def _cells(file: TransferFile, home: str) -> Iterator[Cell]:
    for task in file.tasks:
        for learner in file.learners if task != "presence" else file.learners[:1]:
            for days in file.days:
                usable = WITH_OWN if days else WITHOUT_OWN
                for arm in file.arms:
                    if arm in usable and (arm != "fitted" or days >= FIT_DAYS):
                        yield Cell(task, learner, home, arm, days)


def _add_cells(plan: TransferPlan, name: str, home: HomeEntry) -> None:
    """Add the cells of a home, or note why it has none."""
    file = plan.file
    known = len(home.trace.days)
    possible = [days for days in file.days if days + file.test_days <= known]
    most = max(possible, default=0)
    plan.tested[name] = home.trace.days[most:]
    unfitted = _unfitted(home, possible) if "fitted" in file.arms else {}
    tested = home.trace.activities.reshape(-1, 1440)[plan.tested[name]]
    classes = len({*tested.ravel().tolist()} - {-1})
    for cell in _cells(file, name):
        if cell.days not in possible:
            why = (
                f"{cell.days} days of its own leave {max(known - cell.days, 0)} to test on, of the"
                f" {known} that are known for most of the time; {file.test_days} are needed"
            )
        elif cell.task == "activity" and classes < 2:
            why = "its log names no activities on the days that are tested on"
        elif cell.arm in ("real", "both") and not cell.days and len(plan.homes) < 2:
            why = "there is no other real home to learn from"
        elif cell.arm == "fitted" and cell.days in unfitted:
            why = f"no persona can be fitted to {cell.days} days: {unfitted[cell.days]}"
        else:
            plan.cells.append(cell)
            continue
        words = f"{name}: {why}"
        plan.unfit[words] = plan.unfit.get(words, 0) + 1


def _unfitted(home: HomeEntry, days: list[int]) -> dict[int, str]:
    """Return why no persona can be fitted, by the number of days."""
    reasons = {}
    for count in days:
        if count >= FIT_DAYS:
            try:
                home.fitted(count)
            except LogError as error:
                reasons[count] = str(error)
    return reasons
