"""What the cameras of one body see and perceive of other bodies over a span of steps."""

from typing import NamedTuple

import numpy as np

from fleet2d._core import USER_LOST, USER_SEEN, About, SightingColumn, look
from fleet2d.kernels import I8, I32, I64, U8

__all__ = [
    "USER_LOST",
    "USER_SEEN",
    "LookRule",
    "SightEvents",
    "SightMemory",
    "SightingColumn",
    "UserPoses",
    "look",
    "new_memory",
]


class UserPoses(NamedTuple):
    """The poses of all users over a span: row u is user u, column j is step first + j."""

    x: I64
    y: I64
    heading: I64
    away: U8
    posture: I8


class SightMemory(NamedTuple):
    """The state of a robot's perception between spans.

    An axis of identities has a row for each user, and last one for people who weren't recognized.
    """

    noticed: I64  # (identities,): last step at which the identity was noticed; -1: never
    seen: I64  # (identities,): 1 while the identity counts as seen
    about: I64  # (cameras, users, len(About)): see fleet2d.kernels.perception.About
    backlog: (
        I64  # (cameras, rows, SightingColumn): a ring buffer of sightings that aren't known yet
    )
    waiting: I64  # (cameras, 2): first row and length of the backlog


class SightEvents(NamedTuple):
    """Identities that come into view or are lost, in order of (step, identity)."""

    step: I64
    user: I32
    kind: I32  # USER_SEEN | USER_LOST


class LookRule(NamedTuple):
    """The settings that all cameras of a robot share."""

    patience: int  # steps without a sighting after which an identity counts as lost
    step_us: int
    start_us: int  # time of day at step 0
    burst: int  # most sightings that become known in one step
    stop_lost: bool  # whether an event ends the span
    stop_seen: bool


def new_memory(cameras: int, users: int, backlog: int) -> SightMemory:
    """Return the memory of a robot that has not seen anybody."""
    never = -1
    about = np.zeros((cameras, users, len(About)), np.int64)
    about[..., [About.DRAW_STEP.value, About.TRACK_STEP.value]] = never
    return SightMemory(
        noticed=np.full(users + 1, never, np.int64),
        seen=np.zeros(users + 1, np.int64),
        about=about,
        backlog=np.zeros((cameras, backlog, len(SightingColumn)), np.int64),
        waiting=np.zeros((cameras, 2), np.int64),
    )
