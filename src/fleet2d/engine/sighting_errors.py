"""The errors that act on sightings after the look: components, and the error of localization."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydantic import InstanceOf

from fleet2d.errors import ComponentError, blame
from fleet2d.floorplan.lattice import Lattice
from fleet2d.kernels import (
    I64,
    NOBODY,
    ONE,
    TURN,
    USER_LOST,
    USER_SEEN,
    About,
    SightMemory,
    Window,
    camera_poses,
    in_radians,
)
from fleet2d.kernels import SightingColumn as Column
from fleet2d.runtime.clock import Sun
from fleet2d.runtime.local_time import readings_of
from fleet2d.sight.perception import DARK_NIGHT, DARKEST, Curve, Detection, Perception
from fleet2d.sight.perception_error import CameraSightings, ErrorStream, PerceptionError

if TYPE_CHECKING:
    from fleet2d.engine.cameras import Cameras


def sight_events(
    rows: I64, memory: SightMemory, patience: int, first: int, end: int
) -> list[tuple[int, int, int]]:
    """Return the events (step, identity, kind) of some steps, as `look` notes them, in its order.

    Args:
        rows: The sightings that become known in the steps, (n, columns).
        memory: The memory at the first step; its identities are updated to the end.
        patience: Steps without a sighting after which an identity counts as lost.
        first: The first step.
        end: The step after the last one.
    """
    patience = max(patience, 1)
    events: list[tuple[int, int, int]] = []
    for identity in range(len(memory.seen)):
        number = identity if identity < len(memory.seen) - 1 else -1
        steps = np.unique(rows[rows[:, Column.IDENTITY] == number, Column.STEP])
        if memory.seen[identity]:
            steps = np.concatenate([memory.noticed[[identity]], steps])
        elif not len(steps):
            continue
        else:
            events.append((int(steps[0]), identity, USER_SEEN))
        breaks = np.flatnonzero(np.diff(steps) > patience)
        losses = steps[breaks] + patience
        returns = steps[breaks + 1]
        last = int(steps[-1])
        is_lost = last + patience < end
        losses = np.append(losses, last + patience) if is_lost else losses
        events += [(max(step, first), identity, USER_LOST) for step in losses.tolist()]
        events += [(step, identity, USER_SEEN) for step in returns.tolist()]
        memory.noticed[identity] = last
        memory.seen[identity] = not is_lost
    return sorted(events)


PoseColumns = tuple[I64, I64, I64]  # x, y [lattice units] and heading, one element for each look

# The user of a sighting that an error removed, until it would have become known.
RETRACTED = -2


class Darkness(PerceptionError):
    """People who aren't noticed because the light of their room is off.

    Attributes:
        unlit: Share of people noticed nevertheless, by the time of day [hours].
        sun: The sun, if it sets that share instead.
    """

    unlit: Curve
    sun: InstanceOf[Sun] | None = None

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        """Return the sightings without those that the darkness hides."""
        is_dark = np.isin(sightings.true_room, sorted(sightings.home.unlit))
        is_dark &= sightings.true_user != NOBODY
        if self.sun is None:
            shares = self.unlit.around_the_clock().chances(sightings.hour.tolist()) / ONE
        else:
            elapsed_us = sightings.step * round(1e6 * sightings.step_s)
            times = readings_of(sightings.start, elapsed_us).astype("M8[us]")
            by_day = self.sun.shares(times)
            shares = DARKEST + (1 - DARKEST) * by_day
        is_hidden = is_dark & (sightings.uniform("noticed") >= shares)
        return sightings.replace(noticed=sightings.noticed & ~is_hidden)


class CameraErrors(NamedTuple):
    """The errors of one camera.

    Attributes:
        name: The name of the camera.
        path: The path of the errors in the scenario, "robots.astro.perception.errors".
        errors: The errors by name; they act in the order of the names.
        darkness: The misses where lights are off, which act before the errors.
    """

    name: str
    path: str
    errors: dict[str, PerceptionError]
    darkness: Darkness


class SightingErrors:
    """Changes the sightings of a body in the span of their look, including delayed ones.

    Errors of perception come first, then the error of the belief about the body's own pose.

    Attributes:
        events: Returns the events of changed sightings; see `sight_events`.
    """

    def __init__(self, cameras: "Cameras", perceptions: Sequence[Perception | None]) -> None:
        """Take the errors of the cameras of a body; `perceptions` has one for each camera."""
        owner = self._owner = cameras.owner
        self._row = cameras.row
        self._drift = cameras.drift
        self._lenses = cameras.lenses
        self._users = tuple(cameras.other_names)
        common = getattr(owner.entity, "perception", None)
        self._cameras = []
        self.events = sight_events
        for name, perception in zip(cameras.names, perceptions, strict=True):
            camera = "camera" if "camera" in cameras.names else f"cameras.{name}"
            place = owner.path if perception is common else f"{owner.path}.{camera}"
            path = f"{place}.perception.errors"
            errors = dict(sorted(perception.errors.items())) if perception else {}
            detection = perception.detection if perception else Detection()
            sun = owner.clock.sun if detection.unlit == DARK_NIGHT else None
            darkness = Darkness(unlit=detection.unlit, sun=sun)
            self._cameras.append(CameraErrors(name, path, errors, darkness))

    def change(
        self, rows: I64, memory: SightMemory, before: SightMemory, window: Window, end: int
    ) -> tuple[I64, bool]:
        """Return the sightings that become known in a span, and whether others were seen.

        In that case, the identities in `memory` are those before the span.

        Args:
            rows: The sightings as the look returns them, (n, columns).
            memory: The memory after the look; sightings that wait in it are changed, too.
            before: The memory before the look.
            window: The poses of all bodies, from the first step of the span on.
            end: The step after the last one of the span.
        """
        identities = rows[:, Column.IDENTITY]
        rows = rows.copy("K")
        poses: tuple[I64, ...] = ()
        for c in range(len(self._cameras)):
            here = np.flatnonzero(rows[:, Column.CAMERA] == c)
            waiting = memory.waiting_rows(c)
            part = np.concatenate([rows[here], memory.backlog[c, waiting]])
            looks = part[:, Column.STEP] - self._lenses.latency[c]
            is_new = looks >= window.first
            if not is_new.any():
                continue
            poses = poses or window.dense(self._row, window.first, end)[:3]
            at = looks[is_new] - window.first
            body = poses[0][at], poses[1][at], poses[2][at]
            part[is_new] = self._change(c, part[is_new], looks[is_new], body, memory)
            rows[here] = part[: len(here)]
            memory.backlog[c, waiting] = part[len(here) :]
        is_kept = rows[:, Column.USER] != RETRACTED
        has_others = bool((rows[:, Column.IDENTITY] != identities).any())
        differs = has_others or not is_kept.all()
        if differs:
            memory.noticed[:] = before.noticed
            memory.seen[:] = before.seen
        return rows[is_kept], differs

    def _change(self, c: int, rows: I64, looks: I64, body: PoseColumns, memory: SightMemory) -> I64:
        """Return a camera's sightings in some looks, changed by its errors."""
        camera = self._cameras[c]
        errors = camera.errors
        if self._owner.home.unlit:
            errors = {"": camera.darkness} | errors  # errors of a scenario have no empty names
        if errors:
            eye = camera_poses(self._lenses, c, body, looks * self._owner.clock.step_us)
            old = self._sightings(camera.name, rows, looks, eye)
            new = self._with_errors(camera, errors, old)
            _write(rows, old, new, self._owner.home.lattice)
            missed = rows[~new.noticed & (rows[:, Column.USER] != NOBODY), Column.USER]
            np.subtract.at(memory.about, (c, missed, About.NOTICED.value), 1)
            rows[~new.noticed, Column.USER] = RETRACTED
        if self._drift is not None:
            xy = rows[:, Column.X], rows[:, Column.Y]
            heading = rows[:, Column.HEADING] + self._drift.at(looks).turn
            rows[:, Column.X], rows[:, Column.Y] = self._drift.misplace(*xy, *body[:2], looks)
            rows[:, Column.HEADING] = heading % TURN
        return rows

    def _with_errors(
        self, camera: CameraErrors, errors: dict[str, PerceptionError], sightings: CameraSightings
    ) -> CameraSightings:
        """Return sightings with the errors of a camera, one after the other."""
        owner = self._owner
        for name, error in errors.items():
            stream = ErrorStream(owner.seed, owner.path, f"{camera.name}: errors.{name}")
            with blame(f"{camera.path}.{name}", int(sightings.step[0])):
                before = replace(sightings, _stream=stream)
                sightings = error.distort(before)
                if getattr(sightings, "step", None) is not before.step:
                    raise ComponentError(
                        f"distort returned {sightings!r:.100}: return what sightings.replace(…) or"
                        " sightings.moved(…) returns, or the sightings themselves"
                    )
        return sightings

    def _sightings(self, camera: str, rows: I64, looks: I64, eye: PoseColumns) -> CameraSightings:
        """Return the sightings of some looks of a camera, given its pose in each."""
        owner = self._owner
        lattice = owner.home.lattice
        seen = lattice.to_metres(rows[:, [Column.X, Column.Y]])
        true = lattice.to_metres(rows[:, [Column.TRUE_X, Column.TRUE_Y]])
        at = lattice.to_metres(np.stack(eye[:2], axis=1))
        return CameraSightings(
            camera=camera,
            users=self._users,
            home=owner.home,
            start=owner.clock.start,
            step_s=owner.clock.step_us / 1e6,
            step=looks.copy(),
            user=rows[:, Column.IDENTITY].copy(),
            x=seen[:, 0],
            y=seen[:, 1],
            heading=in_radians(rows[:, Column.HEADING]),
            posture=rows[:, Column.POSTURE].copy(),
            noticed=np.ones(len(rows), np.bool_),
            true_user=rows[:, Column.USER].copy(),
            true_x=true[:, 0],
            true_y=true[:, 1],
            true_heading=in_radians(rows[:, Column.TRUE_HEADING]),
            true_posture=rows[:, Column.TRUE_POSTURE].copy(),
            camera_x=at[:, 0],
            camera_y=at[:, 1],
            camera_heading=in_radians(eye[2]),
        )


def _write(rows: I64, old: CameraSightings, new: CameraSightings, lattice: Lattice) -> None:
    """Write the values that errors changed to sightings, in place and rounded."""
    if new.x is not old.x or new.y is not old.y:
        places = np.stack([new.x, new.y], axis=1)
        rows[:, [Column.X, Column.Y]] = lattice.to_lattice(places)
    if new.heading is not old.heading:
        heading = np.rint(new.heading * (TURN / (2 * math.pi)))
        rows[:, Column.HEADING] = heading.astype(np.int64) % TURN
    rows[:, Column.POSTURE] = new.posture
    rows[:, Column.IDENTITY] = new.user
