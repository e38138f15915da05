"""Frames of ROS: poses in space, and the transforms between the frames of a bag over time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from fleet2d.bounds import FIXES
from fleet2d.kernels import F64, I64, Bool
from fleet2d.logs.log import LogError
from fleet2d.storage.bags import numbers_of, stamp_ns, times_of, unit_turns

MAP = "map"
"""The frame of a floor plan, unless the scenario names another one."""
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")

# Cosine of the tilt from which on a heading says little: 45 degrees.
_STEEPEST = 0.7
# The last transform may be so much older than a pose without a word [ns].
_FRESH_NS = 1_000_000_000
_ALWAYS = np.iinfo(np.int64)


class RigidMotions(NamedTuple):
    """Poses in space, or rigid motions: turned, then moved.

    Attributes:
        place: float64 (n, 3) [m].
        turn: Quaternions x, y, z, w of the length 1, float64 (n, 4); NaN where unknown.
    """

    place: F64
    turn: F64

    @classmethod
    def of_rows(cls, rows: Sequence[Sequence[float]]) -> Self:
        """Return the motions of rows x, y, z of the place, and x, y, z, w of the quaternion."""
        columns = np.array(rows, np.float64).reshape(-1, 7)
        return cls(columns[:, :3], unit_turns(columns[:, 3:]))

    @classmethod
    def still(cls, count: int) -> Self:
        """Return motions that change nothing."""
        return cls.of_rows([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]] * count)

    def where(self, kept: Bool | I64) -> "RigidMotions":
        """Return some of them."""
        return RigidMotions(self.place[kept], self.turn[kept])

    def is_steep(self) -> Bool:
        """Return which are tilted by more than 45 degrees, bool (n,)."""
        x, y, _, _ = self.turn.T
        steep: Bool = 1 - 2 * (x * x + y * y) < _STEEPEST
        return steep

    def after(self, first: "RigidMotions") -> "RigidMotions":
        """Return the motions that do `first`, and then these."""
        return RigidMotions(
            self.place + _turned(self.turn, first.place), _product(self.turn, first.turn)
        )

    def inverse(self) -> "RigidMotions":
        """Return the motions back."""
        back = self.turn * (-1, -1, -1, 1)
        return RigidMotions(-_turned(back, self.place), back)

    def towards(self, end: "RigidMotions", share: F64) -> "RigidMotions":
        """Return those at a share of the way to others, float64 (n, 1), as tf2: slerp of turns."""
        cosine = (self.turn * end.turn).sum(axis=1, keepdims=True)
        angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
        sine = np.sin(angle)
        is_near = sine < 1e-6
        scale = np.where(is_near, 1.0, sine)
        left = np.where(is_near, 1 - share, np.sin((1 - share) * angle)) / scale
        right = np.where(is_near, share, np.sin(share * angle)) / scale
        turn = left * self.turn + np.where(cosine < 0, -right, right) * end.turn
        return RigidMotions((1 - share) * self.place + share * end.place, unit_turns(turn))


def _product(left: F64, right: F64) -> F64:
    """Return the products of quaternions, float64 (n, 4)."""
    real = left[:, 3:] * right[:, 3:] - (left[:, :3] * right[:, :3]).sum(axis=1, keepdims=True)
    rest = left[:, 3:] * right[:, :3] + right[:, 3:] * left[:, :3]
    return np.hstack([rest + np.cross(left[:, :3], right[:, :3]), real])


def _turned(turn: F64, place: F64) -> F64:
    """Return places turned by quaternions, float64 (n, 3)."""
    across = 2 * np.cross(turn[:, :3], place)
    turned: F64 = place + turn[:, 3:] * across + np.cross(turn[:, :3], across)
    return turned


@dataclass
class FrameLink:
    """The transforms from a frame to its parent.

    Attributes:
        is_static: Whether it holds at all times.
        parents: Pairs of the parent and the topic that names it: one, in a tree.
        stamps: Stamps in the order of the bag [ns], 0 where there is none.
        recorded: When each was recorded [ns].
        rows: x, y, z of the place, and x, y, z, w of the quaternion.
    """

    is_static: bool
    parents: set[tuple[str, str]] = field(default_factory=set)
    stamps: list[int] = field(default_factory=list)
    recorded: list[int] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)

    @cached_property
    def time(self) -> I64:
        """The time of each [ns], int64 (n,)."""
        return times_of(np.array(self.stamps, np.int64), np.array(self.recorded, np.int64))

    @property
    def begin(self) -> int:
        """The first time [ns]."""
        return _ALWAYS.min if self.is_static else int(self.time.min())

    @property
    def end(self) -> int:
        """The last time [ns]."""
        return _ALWAYS.max if self.is_static else int(self.time.max())

    def at(self, time: I64) -> RigidMotions:
        """Return the motions at some times, int64 (n,) [ns], between its own interpolated."""
        motions = RigidMotions.of_rows(self.rows)
        if self.is_static:  # the last one counts
            return motions.where(np.full(len(time), len(self.rows) - 1))
        order = np.argsort(self.time, kind="stable")
        own = self.time[order]
        motions = motions.where(order)
        before = np.maximum(np.searchsorted(own, time, side="right") - 1, 0)
        after = np.minimum(before + 1, len(own) - 1)
        share = np.clip((time - own[before]) / np.maximum(own[after] - own[before], 1), 0.0, 1.0)
        return motions.where(before).towards(motions.where(after), share[:, None])


_Way = tuple[list[FrameLink], list[FrameLink]]
"""The links from two frames up to their common ancestor."""


class FrameTree:
    """The frames of a bag, and the transforms between them; read when they are needed.

    Attributes:
        path: The bag.
        notes: Anomalies in its transforms.
    """

    def __init__(self, reader: Any, path: Path) -> None:
        """Wrap an open bag; its transforms are read at first use."""
        self._reader = reader
        self.path = path
        self.notes = list[str]()

    @cached_property
    def links(self) -> dict[str, FrameLink]:
        """The link of each frame to its parent.

        Raises:
            LogError: There are more transforms than the bound.
        """
        connections = [c for c in self._reader.connections if c.msgtype in TRANSFORMS]
        FIXES.check(sum(c.msgcount for c in connections), self.path, LogError)
        links: dict[str, FrameLink] = {}
        left_out = 0
        for connection, time, data in self._reader.messages(connections) if connections else ():
            for one in self._reader.deserialize(data, connection.msgtype).transforms:
                row = numbers_of(one.transform.translation, one.transform.rotation)
                turn = unit_turns(np.array([row[3:]]))
                if np.isnan(row[:3]).any() or np.isnan(turn).any():
                    left_out += 1
                    continue
                topic = connection.topic
                link = links.setdefault(
                    frame_name(one.child_frame_id), FrameLink(topic.endswith("tf_static"))
                )
                link.parents.add((frame_name(one.header.frame_id), topic))
                link.stamps.append(stamp_ns(one))
                link.recorded.append(time)
                link.rows.append(row)
                FIXES.check(len(link.rows), self.path, LogError)
        if left_out:
            self.notes.append(f"{left_out} transforms without a place or a turn were left out")
        return links

    @property
    def frames(self) -> list[str]:
        """The names of all frames."""
        parents = (parent for link in self.links.values() for parent, _ in sorted(link.parents))
        return list(dict.fromkeys([*self.links, *parents]))

    def way(self, frame: str, target: str) -> _Way | None:
        """Return the links from two frames up to their common ancestor; None if there is none.

        Raises:
            LogError: A frame has two parents, or is its own ancestor.
        """
        up = self._chain(frame)
        down = self._chain(target)
        common = next((name for name in up if name in down), None)
        if common is None:
            return None
        rise, fall = (chain[: chain.index(common)] for chain in (up, down))
        return [self.links[name] for name in rise], [self.links[name] for name in fall]

    def _chain(self, frame: str) -> list[str]:
        """Return a frame, its parent and so on, to the root of its tree."""
        chain = [frame]
        while chain[-1] in self.links:
            parents = sorted(self.links[chain[-1]].parents)
            if len(parents) > 1:
                both = " and ".join(f"{parent!r} ({topic})" for parent, topic in parents)
                raise LogError(f"{self.path}: the frame {chain[-1]!r} has two parents, {both}")
            parent = parents[0][0]
            if parent in chain:
                circle = " > ".join([*chain, parent])
                raise LogError(f"{self.path}: the transforms form a circle: {circle}")
            chain.append(parent)
        return chain

    def way_to(self, frame: str, target: str, source: str) -> _Way:
        """Return the links from a frame to another one in any namespace, such as `astro/map`.

        Args:
            frame: The frame.
            target: The name of the other one.
            source: What has poses in the frame, for the message.

        Raises:
            LogError: No transforms lead there; as `way`.
        """
        space = frame.rpartition("/")[0]
        named = [name for name in self.frames if is_named(name, target)]
        for name in sorted(named, key=lambda name: (name != target, not name.startswith(space))):
            if (way := self.way(frame, name)) is not None:
                return way
        root = self._chain(frame)[-1]
        raise LogError(
            f"{self.path}: {source}: no transform leads from the frame {frame!r} to {target!r}"
            f" (frames of /tf: {', '.join(self.frames[:20]) or 'none'}); to take coordinates in"
            f" {root!r} as those of the floor plan, write frame: {{name: {root}}}"
        )


def frame_name(text: str) -> str:
    """Return the name of a frame without the slash that ROS 1 allowed before it."""
    return text.strip().lstrip("/")


def is_named(frame: str, name: str) -> bool:
    """Return whether a frame has a name, in any namespace: `astro/map` is a `map`."""
    return frame == name or frame.endswith(f"/{name}")


class StampedPoses(NamedTuple):
    """Poses over time.

    Attributes:
        time: Stamps [ns], int64 (n,).
        frames: The frame of each; "" where the bag doesn't say.
        motions: The poses.
    """

    time: I64
    frames: Sequence[str]
    motions: RigidMotions

    def seen_from(
        self, target: str, tree: FrameTree, source: str, notes: list[str]
    ) -> tuple[RigidMotions, Bool]:
        """Return the poses in another frame, and which of them are known, bool (n,).

        Args:
            target: The name of the frame, in any namespace.
            tree: The frames of the bag.
            source: What has the poses, for messages.
            notes: Gets a line for each kind of anomaly.

        Raises:
            LogError: No transforms lead from their frame to the target.
        """
        place = self.motions.place.copy()
        turn = self.motions.turn.copy()
        names = np.array(self.frames, object)
        is_known = np.ones(len(names), bool)
        for frame in dict.fromkeys(self.frames):
            at = np.flatnonzero(names == frame)
            if not frame:
                notes.append(f"{len(at)} poses without a frame count as in {target!r}")
            if not frame or is_named(frame, target):
                continue
            rise, fall = tree.way_to(frame, target, source)
            time = self.time[at]
            up, down = (_through(links, time) for links in (rise, fall))
            place[at], turn[at] = down.inverse().after(up).after(self.motions.where(at))
            links = [*rise, *fall]
            is_known[at] = time >= max((link.begin for link in links), default=_ALWAYS.min)
            age = time - min((link.end for link in links), default=_ALWAYS.max)
            notes += _ages(frame, target, age, int((~is_known[at]).sum()))
        notes += tree.notes
        return RigidMotions(place, turn), is_known


def _through(links: Sequence[FrameLink], time: I64) -> RigidMotions:
    """Return the motions from the first of consecutive frames to the parent of the last one."""
    motions = RigidMotions.still(len(time))
    for link in links:
        motions = link.at(time).after(motions)
    return motions


def _ages(frame: str, target: str, age: I64, early: int) -> list[str]:
    """Return lines about poses before the first, and long after the last transform."""
    way = f"transform from {frame!r} to {target!r}"
    notes = [f"{early} poses before the first {way} were left out"] if early else []
    old = age > _FRESH_NS
    if old.any():
        seconds = float(age.max()) / 1e9
        notes.append(
            f"{np.count_nonzero(old)} poses use the last {way}, which is up to {seconds:g} s older"
        )
    return notes
