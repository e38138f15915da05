"""Reports of replays: how a log was interpreted, as lines of text."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from fleet2d.logs.frame import Frame
from fleet2d.logs.log import ActivityLog, PositionLog
from fleet2d.logs.rooms import RoomChoice
from fleet2d.logs.visits import UNKNOWN, LoggedVisits, VisitRule
from fleet2d.sums import sum_in_order

if TYPE_CHECKING:
    from fleet2d.entities.users.follow_fixes import Fixes, FixFollower
    from fleet2d.entities.users.follow_rooms import Paces


def report_rooms(
    log: ActivityLog,
    mapped: Mapping[str, RoomChoice | None],
    logged: LoggedVisits,
    rule: VisitRule,
    paces: "Paces",
    fastest: float,
) -> tuple[str, ...]:
    """Return lines about a log of rooms: which room each label means, omissions, gaps, haste."""
    lines = [_head(log, len(log.readings), "readings"), *log.notes]
    for label, count in sorted(log.rooms.items()):
        choice = mapped[label]
        meaning = "left out" if choice is None else f"taken for {choice[0]}"
        lines.append(f"{label}: {meaning}, {count} readings")
    if logged.overruled:
        lines.append(
            f"{logged.overruled} readings yield to later ones of another room in their step"
        )
    gaps = [visit for visit in logged.visits if visit.place == UNKNOWN]
    hours = sum_in_order(
        (min(v.last + 1, rule.steps) - max(v.first, 0)) * rule.step_us / 3.6e9 for v in gaps
    )
    if gaps:
        lines.append(f"nobody knows where it is in {len(gaps)} gaps, {hours:.1f} h in all")
    if paces.hurried:
        lines.append(
            f"{paces.hurried} of {paces.walks} walks are faster than the body walks, since the log"
            f" leaves no more time; {paces.over} of them faster than {fastest:g} m/s, the fastest"
            f" at {paces.fastest:.1f} m/s"
        )
    return tuple(lines)


def report_fixes(
    log: PositionLog, fixes: "Fixes", follower: "FixFollower", thinned: int, frame: Frame
) -> tuple[str, ...]:
    """Return lines about a log of positions: omitted and moved fixes, gaps, implausible legs."""
    lines = [_head(log, len(log.time_us), "fixes"), *log.notes]
    if frame.matches:
        off = frame.errors()
        lines.append(f"the frame fits its {len(off)} matches to {float(off.max()):.2f} m")
    if thinned:
        lines.append(f"{thinned} fixes are left out: one in a step is enough")
    if fixes.outside:
        lines.append(f"{fixes.outside} fixes are outside the home and left out")
    if fixes.snapped:
        lines.append(f"{fixes.snapped} fixes are moved to the nearest place where the body fits")
    if follower.around:
        lines.append(f"{follower.around} legs go around a wall that a straight line would cross")
    if follower.gap_count:
        hours = follower.unknown_us / 3.6e9
        lines.append(f"nobody knows where it is in {follower.gap_count} gaps, {hours:.2f} h in all")
    if follower.implausible:
        metres = follower.top_speed / follower.actor.home.plan.lattice.units_per_m
        lines.append(
            f"{follower.implausible} legs are too fast to be true, up to {metres:.1f} m/s: check"
            " the frame and the times"
        )
    return tuple(lines)


def _head(log: ActivityLog | PositionLog, count: int, noun: str) -> str:
    since = f" from {log.first_day}" if log.first_day else ""
    days = f"{log.days} day{'' if log.days == 1 else 's'}"
    return f"{log.path.name}, layout {log.layout}: {count} {noun} of {days}{since}"
