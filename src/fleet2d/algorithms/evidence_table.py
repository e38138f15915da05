"""What a robot can know, as a table: what it looked at in each bin, and whom it perceived there."""

from collections.abc import Set
from typing import Any, ClassVar

import numpy as np

from fleet2d.algorithms.algorithm import Algorithm, Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import ANYONE
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home


@register("algorithm", "evidence_table")
class EvidenceTable(Algorithm):
    """What robots looked at, and whom they perceived there, as rows of a table.

    There is a row of `anyone` for each bin (a minute, or a step where that is longer) and each room
    that was in view, or in which somebody was perceived; and one more for each user who was
    recognized there. Rooms that were looked at and empty have `seen` 0. As an algorithm it can't
    read where people are: the table holds nothing that robots don't perceive.

    Columns: `bin`, the first step of the bin; its own time as `day` (as `date.toordinal` counts)
    and `minute` of the day; `room`, and its `kind`; `user`; `watched`, the share of the room in
    view, averaged over the bin; `seen`, the steps at which the user was perceived there.
    """

    needs: ClassVar[Set[str]] = frozenset({"evidence"})

    def start(self, home: Home) -> None:
        """Keep the names and the kinds of rooms."""
        self.names = np.array([room.name for room in home.rooms], object)
        self.kinds = np.array([room.type for room in home.rooms], object)

    def update(self, history: History, state: Present) -> dict[str, Any] | None:
        """Return the rows of the period, by bin, room and user, anyone first; None without any."""
        evidence = history.evidence
        user, bin_, room, steps, shape = evidence.sightings
        anyone = shape[1] - 1
        seen = np.zeros((shape[0], shape[2]), np.int64)
        is_anyone = user == anyone
        seen[bin_[is_anyone], room[is_anyone]] = steps[is_anyone]
        watched_bin, watched_room = np.nonzero((evidence.watched > 0) | (seen > 0))
        known = ~is_anyone
        bins = np.concatenate([watched_bin, bin_[known]])
        rooms = np.concatenate([watched_room, room[known]])
        users = np.concatenate([np.full(len(watched_bin), -1), user[known]])
        counts = np.concatenate([seen[watched_bin, watched_room], steps[known]])
        if not len(bins):
            return None
        order = np.lexsort((users, rooms, bins))
        bins, rooms, users = bins[order], rooms[order], users[order]
        return {
            "bin": evidence.begin + bins * evidence.bin_steps,
            "day": evidence.day[bins],
            "minute": evidence.minute[bins],
            "room": self.names[rooms],
            "kind": self.kinds[rooms],
            "user": np.array([*state.users, ANYONE], object)[users],
            "watched": evidence.watched[bins, rooms],
            "seen": counts[order],
        }
