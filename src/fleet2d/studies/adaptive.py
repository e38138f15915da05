"""Adaptive numbers of seeds: values of an axis get no more of them once the answer is clear."""

from collections import deque
from collections.abc import Callable, Sequence

from fleet2d.studies.directory import StudyDirectory
from fleet2d.studies.executors import TaskSchedule, WorkerTask
from fleet2d.studies.intervals import LEVEL
from fleet2d.studies.plan import PlannedVariant, StudyPlan
from fleet2d.studies.reader import Study
from fleet2d.studies.specification import AdaptSettings


class AdaptiveSchedule(TaskSchedule):
    """The tasks of a study in rounds of seeds; between rounds the results so far decide.

    All values of the axis have the same seeds as long as they get any, so pairs stay fair. To give
    up a value, its difference must be significant at 5 % over all rounds together (Bonferroni).
    """

    def __init__(
        self,
        settings: AdaptSettings,
        plan: StudyPlan,
        missing: Sequence[WorkerTask],
        directory: StudyDirectory,
        on_note: Callable[[str], None],
    ) -> None:
        """Start the first round.

        Args:
            settings: The section `adapt` of the study file.
            plan: All variants.
            missing: The tasks of variants without results.
            directory: The study, for results so far.
            on_note: Receives a remark for each decision.
        """
        super().__init__(())
        self._settings, self._design = settings, plan.design
        self._directory, self._on_note = directory, on_note
        self._missing = {task.number: task for task in missing}
        self._dropped = set[object]()
        seeds = len(plan.design.seeds)
        self._rounds = deque(
            [v for v in plan.variants if first <= v.index % seeds < first + settings.seeds]
            for first in range(0, seeds, settings.seeds)
        )
        self._looks = len(self._rounds) - 1
        self._unfinished = 0
        self._variants = list[PlannedVariant]()
        self._start_round()

    @property
    def plan(self) -> StudyPlan:
        """The variants of all rounds so far."""
        return StudyPlan(self._design, tuple(sorted(self._variants, key=lambda v: v.index)))

    def on_end(self) -> None:
        """Count a task that has ended; after the last of a round, the next one starts."""
        self._unfinished -= 1
        if not self._unfinished:
            self._start_round()

    def _start_round(self) -> None:
        while self._rounds and not self._unfinished:
            if self._variants:
                self._decide()
            ((axis, _),) = self._settings.against.items()
            labels = self._design.parameters
            part = self._rounds.popleft() if self._rounds else []
            variants = [v for v in part if labels(v.index)[axis] not in self._dropped]
            self._variants += variants
            for variant in variants:
                if task := self._missing.get(variant.number):
                    self.add(task)
                    self._unfinished += 1

    def _decide(self) -> None:
        """Give up values that are clearly worse, and all further rounds if intervals are narrow."""
        settings, study = self._settings, Study(self._directory)
        ((axis, _),) = settings.against.items()
        seeds = len(set(study.complete["seed"].to_list()))
        table = study.paired(settings.metric, settings.against).to_dicts()
        open_rows = [row for row in table if row[axis] not in self._dropped]
        sign = -1 if settings.goal == "maximize" else 1
        for row in open_rows if settings.goal else ():
            if sign * row["difference"] > 0 and row["p"] < (1 - LEVEL) / self._looks:
                self._dropped.add(row[axis])
                self._on_note(f"{axis} = {row[axis]} is clearly worse after {seeds} seeds: dropped")
        left = [row for row in open_rows if row[axis] not in self._dropped]
        width = max((row["high"] - row["low"] for row in left), default=0.0)
        if not left or (settings.width is not None and width <= settings.width):
            self._rounds.clear()
            self._on_note(
                f"no more than {seeds} seeds: "
                + (f"intervals are {width:.3g} wide" if left else "all values are worse")
            )
