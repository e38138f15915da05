"""What the core refuses, beyond wrong types: right calls of which one part is changed."""

import math
import pickle

import numpy as np
import pytest
from tests.kernels.calls import CALLS, HOME, STEPS, OneRoom, named
from tests.kernels.test_core import STATES

from fleet2d.kernels import Poses, Resident, Waits, Window, empty_pose_cache

HUGE = 2**62
LAW = ([60, 600], 60, 600, 0, 1 << 24)
WAITS = Waits(np.array([5, 9]))


def none_of(array):
    return array[:0]


def all_but_the_last(array):
    return array[:-1]


def reversed_(array):
    return array[::-1].copy()


def narrower(array):
    return array[..., :-1].copy()


def beyond(array):
    return array + array.dtype.type(10**6)


def below(array):
    return array - array.dtype.type(10**7)


def no_rows(track):
    return type(track)(*(column[:0] for column in track))


def full_cache(_):
    cache = empty_pose_cache(8, 2)
    cache.number[:] = 0
    return cache


def without_corners(heights):
    return heights._replace(start=np.zeros(2, np.int64), corners=heights.corners[:0])


def far_away(_):
    poses = Poses(*[np.full((3, STEPS), 2**41)] * 3, np.zeros((3, STEPS), np.uint8))
    return Window(0, *poses, np.zeros((3, STEPS), np.int8))


def few_bins(record):
    return record._replace(binned=record.binned[:1], peak=record.peak[:1])


def walking(away, posture):
    """Let somebody without known routes walk as the home says."""
    resident = Resident(1, 100.0, 100.0, None, [])
    return lambda args: (resident, args[1], lambda *_: ((0, 0, 0, 0, away), posture), *args[3:])


# By call: the changed part, as numbers and names of fields; its value, or what makes it; the message.
REFUSED = {
    "Bits.take": [("1", 31, "count must be 0 to 30")],
    "CoreVenue": [
        ("2", True, "makes no small moves"),
        ("3", 4, "choose must be 0 to 3"),
        ("4", -1, "postures must be 0 to 127"),
        ("8", [(3, WAITS)], "kinds of moves must be 0 to 2"),
        ("8", [(1, WAITS), (0, WAITS)], "turns come before other moves"),
        ("8", [(1, WAITS)] * 4, "three kinds of small moves"),
        ("9.0", [9, 8], "quantiles must ascend"),
        ("9", ([-5, 8], -5, 8, 0, 1), "must take 0 s or more"),
    ],
    "DayPlanner": [
        ("0.0", [], "quantiles must ascend"),
        ("0.0", [9, 8], "quantiles must ascend"),
        ("0.2", 2**36, "within 2"),
        ("0.4", (1 << 24) + 1, "positions must be among"),
        ("1", -1, "min_sleep must be 0"),
        ("2.0.2", ([-1, 9], -1, 9, 0, 1), "jobs must take 0 s or more"),
        ("2.0.3", 2**41, "jobs must end within"),
        ("2.0.4", [0], "jobs must come after earlier ones"),
        ("3.0.1", 0, "weights must be 1"),
        ("3", [(3, 2**30, LAW, 0, 9)] * 2, "the sum of all weights"),
        ("3.0.2", ([0, 1], 0, 1, 0, 1 << 24), "pastimes must take 0 s or more"),
    ],
    "DayPlanner.draw_order": [("2", [True] * 3, "chosen must be of each job")],
    "DayPlanner.plan": [
        ("3", 2**20, "within 2"),
        ("5", [], "rooms must be those of each job"),
    ],
    "Interruptions": [
        ("0.0.0.0.0", 4, "no such activity"),
        ("0.0.0.0.1", 1025, "chances must be 0 to 1024"),
        ("0.0.0.0.2", all_but_the_last, "quantiles must be 256"),
        ("0.0.1", [0] * 256, "quantiles must be 1 to 2"),
        ("0.0.2", [2**40] * 256, "quantiles must be 1 to 2"),
        ("0.0.3.1", -1, "chances must be 0 to 1024"),
        ("0.0.4", -1, "patience must be 0 to 2"),
        ("0.0.5.0", -1, "hours must begin at 0"),
        ("0.0.6.0", -1, "no such activity"),
        ("2", [4], "no such activity"),
        ("4", 4, "no such activity"),
        ("5", 0, "activities must be 1 to 2"),
    ],
    "Interruptions.interrupt": [
        ("2", [], "must have an episode"),
        ("2.0.0", 4, "no such activity"),
        ("2.0.2", -1, "end after they begin"),
        ("2.2.2", 2**20, "within 2"),
        ("4", [[], []], "rooms must be those of each activity"),
    ],
    "Legs.add": [
        ("1.0.0", HUGE, "must be"),
        ("1.0.1", 2**30, "must be"),
        ("1.0.4", 2, "must be"),
    ],
    "Legs.go": [("8", -1.0, "speed")],
    "Legs.mark": [("1", HUGE, "must be"), ("2", 2**30, "must be"), ("5", 2, "must be")],
    "Legs.settle": [("5", 2**40, "pose"), ("8", 0.0, "speed")],
    "Legs.turn": [("7", 0.0, "turn_rate")],
    "Legs.walk": [("3", none_of, "route")],
    "Resident": [
        ("1", 0.0, "speed and turn_rate"),
        ("4.0.2", 2**30, "a pose must be within"),
    ],
    "Resident.live": [
        ("1", OneRoom(spots=[]), "a room must have a spot"),
        ("1", OneRoom(spots=[(2**30, 0)]), "a pose must be within"),
        ("", walking(2, 0), "away must be 0 or 1"),
        ("", walking(0, -1), "postures must be 0 to 127"),
        ("4.1", 2**30, "a pose must be within"),
        ("5", 128, "postures must be 0 to 127"),
        ("6.0.1", -1, "numbers of stints"),
        ("6.0.2", 2**39, "stints must end within"),
        ("6.0.3", 4, "roles must be 0 to 3"),
    ],
    "RoomUse.add": [("3", 299, "must end after it begins")],
    "RoomUse.free": [("3", 2**41, "within 2")],
    "Routes": [
        ("1.vertex", reversed_, "must"),
        ("1.vertex", beyond, "must"),
        ("1.before", all_but_the_last, "must"),
        ("1.after", below, "must"),
        ("1.simple", all_but_the_last, "must"),
    ],
    "Routes.around": [
        ("5", narrower, "n, 3"),
        ("5.0.2", -1, "distance to a disc"),
        ("5.0.0", 2**40, r"2\*\*30"),
    ],
    "StepDraws.below": [
        ("1", bound, f"bound is {bound}: it must be from 1 to") for bound in (0, -1, 2**31, HUGE)
    ],
    "Timelines": [("0", -1, "0 or more"), ("1", 0, "1 or more")],
    "Timelines.follow": [
        ("1", 2, "no such body"),
        ("1", -1, "no such body"),
        ("2", -1, "step"),
        ("2", 2**60, "step"),
        ("3.x", all_but_the_last, "one length"),
        ("3.time", reversed_, "ascend"),
        ("3.x.1", 2**41, "small"),
        ("4", reversed_, "ascend"),
        ("5", all_but_the_last, "one more"),
    ],
    "Timelines.pose": [("1", 2, "no such body"), ("2", -1, "step")],
    "Timelines.runs": [("1", 3, "no such body")],
    "Timelines.walk": [
        ("1", 2, "no such body"),
        ("2", -1, "step"),
        ("5.stride", -1, "stride"),
        ("5.sway", 2**60, "sway"),
        ("5.turn_limit", 2**40, "turn_limit"),
        ("6.0", 2**30, "start"),
    ],
    "Timelines.window": [("1", -1, "step"), ("2", 1, "before"), ("2", 2**60, "step")],
    "Waits": [
        ("0", waits, "waits must be a power of two")
        for waits in ([], [0], [0, 0], [1, 2, 3], [-1, 5], [2**61])
    ],
    "Window.dense": [
        ("1", 3, "no such body"),
        ("2", -1, "within the window"),
        ("3", STEPS + 1, "within the window"),
    ],
    "add_obstacles": [("0.0.8", -1, "numbers must be"), ("3", 10, "half must be")],
    "cells_in_view": [
        ("4.near_squared", -1, "near_squared and far_squared"),
        ("4.far_squared", 2**52, "near_squared and far_squared"),
        ("4.half_angle", -1, "half_angle"),
        ("5", -1, "rows and columns"),
    ],
    "charge_at": [
        ("1.level", 1.5, "must be"),
        ("1.level", math.nan, "must be"),
        ("1.driving", 0.0, "must be"),
        ("1.charging", math.nan, "must be"),
    ],
    # A damaged call read headings behind the end of their array.
    "charge_falls_to": [
        (f"0.{column}", none_of, "its arrays have one length")
        for column in ("x", "y", "heading", "away")
    ],
    "count_together": [
        (side, begin, "must ascend from 0")
        for side in "02"
        for begin in ([1, 2], [0, 0], [0, -1], [0, 9])
    ],
    # A step of no length divided by 0, a long pan never ended, others were read beyond the window.
    "detect": [
        ("1.pan_us.1", 2**61, "pan_us"),
        ("3.step_us", 0, "step_us"),
        ("3.step_us", -1, "step_us"),
        ("3.step_us", 2**61, "before"),
        ("3.start_us", -1, "start_us"),
        ("3.start_us", 2**61, "start_us"),
        ("5", 3, "no such body"),
        ("6", 2**63 - 1, "fewer others"),
        ("10.eyes.0.0", 2**13, "heights must be in 0"),
        ("10.eyes", all_but_the_last, "eyes must be"),
        ("10.tops", all_but_the_last, "tops"),
        ("10.points", all_but_the_last, "points must be"),
        ("10.start", all_but_the_last, "start must have one more"),
        ("10.corners", all_but_the_last, "start must cover"),
        ("10", without_corners, "each piece must have corners"),
    ],
    "distance_bin": [("2", 2**30 + 1, r"within 2\*\*30"), ("3", -(2**63), r"within 2\*\*30")],
    "distances_between": [("2", 3, "no such body")],
    "earth_mover": [
        ("0.0.0", math.nan, "finite"),
        ("1.0.0", math.nan, "finite"),
        ("2.0.0", math.nan, "finite"),
        ("1", all_but_the_last, "must be"),
        ("2", all_but_the_last, "must be"),
    ],
    "gather_views": [
        ("0", narrower, "cells must be"),
        ("1", reversed_, "rooms of patches"),
        ("3", all_but_the_last, "rooms of patches"),
        ("3.0", 0, "not be empty"),
    ],
    "group_places": [
        ("0.before_walls", all_but_the_last, "before_walls must be"),
        ("1", all_but_the_last, "must have one shape"),
        ("2.far", 0, "width, depth and far"),
    ],
    # That to (-2**63, -2**63) was turned for ever: products would leave 64 bits.
    "heading_of": [
        ("0", 2**31 + 1, r"within 2\*\*31"),
        ("1", -(2**31) - 1, r"within 2\*\*31"),
        ("0", -(2**63), r"within 2\*\*31"),
    ],
    "is_promising": [("0.0.0", 3, "indices of limits")],
    "learned_stays": [
        ("4", first, "first must ascend from 0") for first in ([1, 2, 3, 4], [0, 3, 2, 4], [0, 2])
    ],
    # The square of a distance left 64 bits: it was in a bin before the first.
    "length": [("0", 2**30 + 1, r"within 2\*\*30"), ("1", -(2**63), r"within 2\*\*30")],
    "mark_spans": [
        ("0.0.0", 3, "spans must lie in the mask"),
        ("0.0.0", -1, "spans must lie in the mask"),
        ("0.0.1", -1, "spans must lie in the mask"),
        ("0.0.2", 4, "spans must lie in the mask"),
    ],
    "move_walls": [("2", 10, "half must be")],
    "perceived_offset": [("5", 2**30 + 1, r"within 2\*\*30"), ("6", -(2**63), r"within 2\*\*30")],
    "place_beside": [("4", (20 * 64, 0), "place must be in a cell")],
    "points_in_reach": [("4", narrower, "points"), ("4.0.1", 2**40, "points")],
    "points_in_sight": [("3", narrower, "points"), ("3.0.1", 2**40, "points")],
    "record_coverage": [
        ("0.every", 0, "every"),
        ("0.patch_of_cell", lambda patches: patches + np.int16(9), "patches"),
        ("0.patch_of_cell", all_but_the_last, "patch_of_cell"),
        ("1", far_away, "lattice units"),
        ("2", 3, "no such body"),
        ("2", -1, "no such body"),
        ("3", -1, "within the window"),
        ("4", STEPS + 1, "within the window"),
        ("4", -1, "within the window"),
        ("5", lambda _: empty_pose_cache(6, 2), "a power of two"),
        ("5", lambda _: empty_pose_cache(8, 3), "cells must be"),
        ("5", full_cache, "more slots of cache"),
        ("5.number", lambda numbers: numbers[:4], "twice as many slots"),
        ("6", few_bins, "a row for every bin"),
    ],
    "region_contains": [("1", -1, "an eye")],
    "region_contains_points": [
        ("3", all_but_the_last, "one length"),
        ("3", beyond, "right must hold"),
        ("4", below, "wall must hold"),
    ],
    "region_outline": [
        ("3", all_but_the_last, "one length"),
        ("3", beyond, "right must hold"),
        ("4", below, "wall must hold"),
    ],
    "regions_of_cells": [
        ("1.0.0", HOME.rows, "in cell_triangles"),
        ("2", beyond, "the triangle of each"),
    ],
    "remember": [
        ("2.0", 1, "there is no such"),
        ("2.0", -2, "there is no such"),
        ("3.0", 2, "there is no such"),
    ],
    "settle_coverage": [("2", none_of, "seen must be")],
    "sliding_max": [
        ("0", reversed_, "ascend"),
        ("1.0", math.nan, "numbers"),
        ("2", 7, "before end"),
        ("3", 5, "low"),
    ],
    "squarest_rooms": [
        ("0.nodes.0.0", -3, "a cut must be"),
        ("0.nodes.0.1", 3, "end within nodes"),
        ("0.nodes.1.0", 3, "indices of areas"),
        ("0.nodes.1.1", 0, "1 to 100 %"),
        ("0.nodes", [(-1, 1)] * 70 + [(0, 100)], "64 nodes deep"),
    ],
    "steady_chance": [("3", 2**30 + 1, r"within 2\*\*30"), ("4", -(2**63), r"within 2\*\*30")],
    "strip_rooms": [("1.0", 0.0, "above 0")],
    "sum_places": [
        ("0.0", narrower, "a chain must be"),
        ("0.0", all_but_the_last, "chains must be"),
        ("0.1.0", 4, "a chain must be"),
        ("0.1.0", 0, "a chain must be"),
        ("0.2", [0, 1, 5], "a chain must be"),
        ("0.2", [0, 3, 2], "chains must be"),
        ("0.2", [0, 2, 6], "chains must be"),
        ("1", all_but_the_last, "a chain must be"),
        ("2", 3, "no users"),
        ("3", [1, 2], "ascend"),
        ("3", [0, 0], "ascend"),
        ("3", [0, 6], "ascend"),
    ],
    "time_route": [
        ("3", 0.0, "above 0"),
        ("3", -1.0, "above 0"),
        ("3", math.nan, "above 0"),
        ("4", 0.0, "above 0"),
    ],
    "trace_meander": [
        ("2.stride", -1, "stride"),
        ("2.stride", 2**31, "stride"),
        ("2.sway", -1, "sway"),
        ("2.turn_limit", -1, "turn_limit"),
    ],
    "trace_track": [
        ("0", no_rows, "1 or more"),
        ("0.x", all_but_the_last, "one length"),
        ("0.time", reversed_, "ascend"),
        ("0.time", lambda time: time << 38, "short"),
        ("0.x.1", 2**41, "small"),
        ("2", 0, "step"),
        ("2", 2**60, "step"),
    ],
    "turn_and_stretch": [
        ("0", 2**30 + 1, r"within 2\*\*30"),
        ("1", -(2**63), r"within 2\*\*30"),
        ("3", 0, "distance must be"),
        ("3", -5, "distance must be"),
        ("3", 2**40, "distance must be"),
    ],
    "until": [("2.0", math.nan, "numbers")],
    "wing_rooms": [("1.0.2", -60, "deeper than 0")],
}


def changed(value, at, new):
    """Return a value with another part at a place."""
    if not at:
        result = new(value) if callable(new) else new
        return np.array(result, value.dtype) if isinstance(value, np.ndarray) else result
    if isinstance(value, np.ndarray):
        result = value.copy()
        result[tuple(map(int, at))] = new
        return result
    number = int(at[0]) if at[0].isdigit() else value._fields.index(at[0])
    parts = [changed(p, at[1:], new) if i == number else p for i, p in enumerate(value)]
    return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)


@pytest.mark.parametrize(
    ("name", "at", "new", "message"),
    [(name, *row) for name, rows in REFUSED.items() for row in rows],
)
def test_wrong_values_are_refused_and_change_nothing(name, at, new, message):
    args = changed(CALLS[name](), at.split(".") if at else [], new)
    states = [arg for arg in args if type(arg).__name__ in STATES]
    before = pickle.dumps(states)

    with pytest.raises(ValueError, match=message):
        named(name)(*args)
    assert before == pickle.dumps(states)
