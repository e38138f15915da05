"""Replay of a real robot's detections, from a table or a topic of a bag."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely
from pydantic import Field

from fleet2d.configuration.problems import check_known, counted, suggest
from fleet2d.configuration.units import InputFileOrFolder, Length
from fleet2d.entities.behavior import Actor
from fleet2d.entities.entity import SIGHTING, EvidenceSource
from fleet2d.errors import errors_as
from fleet2d.kernels import F64, I64, NOBODY, TURN, UNKNOWN_TRUTH, Bool, rounded
from fleet2d.kernels import SightingColumn as Column
from fleet2d.logs.log import Day, LogError, LogKeys, files_of, in_run
from fleet2d.logs.placement import COORDINATE_LIMIT_M, MAX_OUTSIDE, LogFrame
from fleet2d.storage.bags import is_bag

if TYPE_CHECKING:
    from fleet2d.logs.detections import RobotDetections


# Labels of usual detectors for people who aren't identified.
ANONYMOUS = frozenset({"unknown", "person", "people", "human", "none", "nobody", "0", ""})


class ReplayedDetections(EvidenceSource, LogKeys):
    """Perceive the detections of a real robot, from a table or a topic of a bag.

    Detections replace simulated sight for algorithms, behaviors and metrics. The true people are
    unknown, so metrics that compare with the truth leave these observations out, and give their
    number. A detection outside of the home by more than `reach` is left out and counted; if more
    than half of them are, the log is refused.

    Attributes:
        path: The table (.csv, .parquet, .jsonl), or the bag.
        topic: The topic of a bag, if several have detections.
        columns: The columns of a table, as {user: face}; or the fields of a bag's messages, as
            {each: people, user: name, x: pose.position.x, y: pose.position.y}.
        people: The user of each label of the log, as {face_7: ana}; null: somebody unknown. Labels
            that are names of users, or words like person, needn't be listed.
        relative_to: Whether positions are in the floor plan, after `frame`, or in the frame of the
            robot: x ahead, y to the left.
        frame: The transform from the positions of the log to the floor plan.
        day: The day of the log that is the first of the run: a number from 0, its date, or the
            first of the same weekday.
        reach: A detection farther than this from the home's floor is left out.
    """

    path: InputFileOrFolder
    topic: str | None = None
    people: dict[str, str | None] = Field(default={})
    relative_to: Literal["map", "robot"] = "map"
    frame: LogFrame = LogFrame()
    day: Day = 0
    reach: Length = Field(default=1.0, ge=0)

    def files(self) -> tuple[Path, ...]:
        """Return the files that it reads."""
        return files_of(self.path)

    def start(self, actor: Actor, users: Sequence[str]) -> None:
        """Read the log.

        Raises:
            LogError: The log can't be read, has labels of nobody, or doesn't fit the home or the
                run.
        """
        # The module needs more of pyarrow than most runs, so it is imported here.
        from fleet2d.logs.detections import read_detections

        is_robots = self.relative and is_bag(self.path)
        with errors_as(LogError, f"{actor.path}.perceives", of=LogError):
            frame = self.frame.name or ("base_link" if is_robots else None)
            log = read_detections(
                self.path, topic=self.topic, frame=frame, **self.reading(actor.clock)
            )
            self._rows = self._place(log, actor, users)

    def sightings(self, first: int, end: int) -> I64:
        """Return the detections of the steps from `first` to `end` - 1."""
        begin, stop = np.searchsorted(self._rows[:, Column.STEP], (first, end)).tolist()
        return self._rows[begin:stop]

    def _place(self, log: "RobotDetections", actor: Actor, users: Sequence[str]) -> I64:
        """Return the detections within the run as rows, and write the notes."""
        clock = actor.clock
        frame = self.frame.in_unit(log.unit_m)
        identity = identities(log.labels, log.counts, self.people, users)[log.label]
        log, begin_us, outside_notes = in_run(log, self.day, clock)
        step = (log.time_us - begin_us) // clock.step_us
        used = (step >= 0) & (step < clock.steps)
        xy = frame.to_plan(log.xy)
        turns = frame.turn_headings(log.heading / (2 * np.pi))
        since = f" from {log.first_day}" if log.first_day else ""
        notes = [
            f"{log.path.name}: {len(step)} detections of {counted(log.days, 'day')}{since}; who"
            " was really there is unknown",
            *log.notes,
            *frame.notes(),
            *outside_notes,
        ]
        if not self.relative:
            used &= self._inside(xy, used, actor, notes)
        for number, name in enumerate(["nobody known", *users], NOBODY):
            if count := int((identity[used] == number).sum()):
                notes.append(f"{count} detections of {name}")
        self.notes = tuple(notes)
        rows = np.zeros((int(used.sum()), SIGHTING), np.int64)  # zeros: camera 0, standing people
        lattice = actor.home.lattice
        places = np.clip(xy[used], -COORDINATE_LIMIT_M, COORDINATE_LIMIT_M)
        if self.relative:
            points = rounded(places * lattice.units_per_m)
        else:
            points = lattice.to_lattice(places)
        turned = np.nan_to_num(turns[used])
        heading = np.floor(turned * TURN + 0.5).astype(np.int64) % TURN
        rows[:, Column.STEP] = step[used]
        rows[:, Column.IDENTITY] = identity[used]
        rows[:, Column.USER] = UNKNOWN_TRUTH
        rows[:, [Column.X, Column.Y]] = rows[:, [Column.TRUE_X, Column.TRUE_Y]] = points
        rows[:, Column.HEADING] = rows[:, Column.TRUE_HEADING] = heading
        return rows

    def _inside(self, xy: F64, used: Bool, actor: Actor, notes: list[str]) -> Bool:
        """Return which detections are in the home, within `reach`.

        Raises:
            LogError: More than MAX_OUTSIDE of the detections in the run are outside.
        """
        free = actor.home.plan.free_space
        shapely.prepare(free)
        off = np.flatnonzero(used & ~shapely.contains_xy(free, xy))
        metres: F64 = np.atleast_1d(shapely.distance(free, shapely.points(xy[off])))
        far = metres > self.reach
        is_inside = np.ones(len(xy), bool)
        is_inside[off[far]] = False
        outside = int(far.sum())
        count = int(used.sum())
        if count and outside > MAX_OUTSIDE * count:
            raise LogError(
                f"the frame of {self.path} doesn't fit the home: {outside} of {count} detections"
                f" are more than {self.reach:g} m outside, by {float(np.median(metres[far])):.1f} m"
                " in the median: correct 'frame' (origin, rotation_deg, or matches), or say"
                " relative_to: robot if they are in the robot's frame"
            )
        if outside:
            notes.append(
                f"{outside} of {count} detections are outside the home and left out, by up to"
                f" {float(metres.max()):.1f} m"
            )
        if len(off) > outside:
            notes.append(
                f"{len(off) - outside} detections are in or behind walls, by up to"
                f" {float(metres[~far].max()):.2f} m, and count for the nearest room"
            )
        return is_inside


def identities(
    labels: Sequence[str],
    counts: Mapping[str, int],
    people: Mapping[str, str | None],
    users: Sequence[str],
) -> I64:
    """Return the user of each label, NOBODY for somebody unknown, and last for no label.

    Args:
        labels: The labels of a log.
        counts: Number of detections with each label.
        people: The users chosen in the scenario, by label.
        users: The users of the run.

    Raises:
        LogError: A label stands for nobody, or a choice names an unknown label or user.
    """
    for label, user in people.items():
        if label not in labels:
            raise LogError(
                f"people: the log has no label {label!r}{suggest(label, labels, 'It has')}"
            )
        if user is not None:
            check_known(user, "user", users, LogError, "people: ")
    rows = []
    for label in labels:
        user = people.get(label, label if label in users else None)
        is_known = label in people or label in users or label.strip().lower() in ANONYMOUS
        if not is_known:
            raise LogError(
                f"no user is named {label!r} ({counts[label]} detections): say who it is by"
                f" people: {{{label}: NAME}}, or null for somebody unknown; users:"
                f" {', '.join(users)}"
            )
        rows.append(NOBODY if user is None else list(users).index(user))
    return np.array([*rows, NOBODY], np.int64)
