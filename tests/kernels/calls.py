"""A right call of every function, constructor and method of the core that takes anything."""

import numpy as np
import shapely
from tests.meshed_homes import home_of

from fleet2d import _core
from fleet2d.floorplan.lattice import Lattice
from fleet2d.kernels import (
    NEVER,
    BatteryState,
    Breakpoints,
    Corners,
    CorridorRule,
    CoverageRecord,
    CoverageSetup,
    DayEvidence,
    DetectionRule,
    Distances,
    Divisions,
    GroupRule,
    Heights,
    Moments,
    PlaceNetwork,
    Reach,
    RoomFloor,
    RoomMemory,
    ShownMemory,
    StayModel,
    Stretches,
    TracedEvidence,
    TracedRooms,
    WalkRule,
    empty_pose_cache,
    empty_poses,
    new_memory,
    trace_size,
)
from fleet2d.sight.camera import Camera, TableContext, error_tables, stack_lenses
from fleet2d.sight.perception import Perception

SECOND = 1_000_000
HOME = home_of([shapely.box(0, 0, 1280, 960).difference(shapely.box(500, 300, 640, 700))])
MESH = HOME.mesh
LATTICE = Lattice(0.05, (0.0, 0.0), HOME.columns, HOME.rows)
CAMERAS = [
    Camera(range=(0.1, 0.6), angle_deg=108, body_points=4),
    Camera.model_validate(
        {
            "range": [0, 0.4],
            "offset": [0.05, -0.02],
            "heading_deg": 40,
            "period": "2 s",
            "latency": "3 s",
            "pan": {"headings_deg": [-60, 0, 60], "dwell": "2 s"},
        }
    ),
]
ERRS = Perception.model_validate(
    {
        "detection": {"distance": [[0, 1], [1, 0.5]], "memory": "5 s"},
        "identity": {"mistaken": 0.2, "per_track": True},
        "attributes": {
            "range_noise": 0.1,
            "bearing_noise_deg": 3,
            "posture": {"sit": {"lie": 0.3}},
        },
        "false_positives": {
            "per_hour": 900,
            "spots": [{"at": [0.3, 0.3], "per_hour": 100, "spread": 0.1}],
        },
    }
)
USERS = 2
STEPS = 9
POINTS = np.array([[100, 100], [300, 900], [-5, 2**29], [500, 300]])
AREAS = np.array([3000.0, 4000.0, 2000.0])
LIMITS = np.array([[20.0, 3.0]] * 3)
SLOTS = np.array([[0, -1, 0], [1, 2, 10]])
WING = (SLOTS, SLOTS[::-1], AREAS)
MASK = np.array([[1, 1, 0, 1], [0, 1, 0, 1], [1, 1, 1, 1]], bool)
COSTS = np.array([[0, 100, -1, 5], [1000, 0, -1, 0], [0, 0, 0, 20]], np.int32)
KEY = 2**64 - 3


def scene():
    return TableContext(
        [f"u{i}" for i in range(USERS)], [100.0] * USERS, LATTICE, SECOND, "robots.r"
    )


def lenses():
    return stack_lenses([c.lens(1280, SECOND) for c in CAMERAS], [True, False], scene())


def errors():
    return error_tables([c.lens(1280, SECOND) for c in CAMERAS], [ERRS, None], scene())


def signal():
    return np.array([0, 3, 7]), np.array([1.0, 2.0, 0.5])


def window():
    x = np.array([[100, 100, 110, 120, 200, 200, 200, 100, 100]] * 3)
    x[1:] += [[150], [700]]
    away = np.zeros(x.shape, np.uint8)
    away[1, 2] = 1
    return _core.Window(0, x, x // 2 + 200, x * 7 % 4096, away, (x % 3).astype(np.int8))


def poses():
    out = empty_poses(STEPS)
    for column in out:
        column[:] = np.arange(STEPS) * 20
    out.away[:] = 0
    return out


def track():
    row = np.arange(5) * SECOND
    return Breakpoints(row, row // 20_000, row // 30_000, row % 4096, np.zeros(5, np.uint8))


def battery():
    return BatteryState(0.5, SECOND, -1e-8, -1e-9, 1e-8, 5, 7, is_broken=False)


def memory():
    shape = 3, 2
    return RoomMemory(
        np.full(shape, -1), np.zeros((*shape, 24), np.int64), np.zeros(shape, np.int64)
    )


def setup():
    patches = np.full((HOME.rows, HOME.columns), -1, np.int16)
    patches[:6], patches[6:12] = 0, 1
    return CoverageSetup(MESH, lenses(), patches, SECOND, 1, 4)


def floor():
    before_walls = np.stack([_core.corner_sums(MASK)] * 4)
    return RoomFloor(MASK, MASK, before_walls, MASK.astype(np.int64))


def record():
    def never():
        return np.full((HOME.rows, HOME.columns), NEVER, np.int64)

    bins = (np.zeros((3, 2), np.int64) for _ in range(2))
    return CoverageRecord(never(), never(), np.zeros(2, np.int64), never(), *bins)


def model():
    follow = np.array([[0, 0.6, 0.3, 0.1], [0.5, 0, 0.4, 0.1], [0.7, 0.3, 0, 0]])
    spread = np.array([0.4, 0.6, 1.0, 1.0])
    first = np.array([0, 2, 3, 4])
    return StayModel(np.full(3, 0.9), follow, spread, np.array([0.1, 0.0, 0.0]), first, 0.8)


def needs_and_errands():
    """Return a need and an errand of somebody who does four activities, the third of them sleep."""
    often = list(range(1000, 1256))
    need = ([(3, 1024, often)], often, often, (512, 512, 512, 512), 900, (3600, 80_000), [1])
    return [need], [((3, 300, often), None, [1])], [], [1], 2, 4


def day_plan():
    """Return the plan of a day: two jobs, the second after the first, and a pastime."""

    def law(shortest, longest):
        return ([shortest, longest], shortest, longest, 0, 1 << 24)

    jobs = [
        (2, law(30_000, 40_000), law(600, 1200), 80_000, [], 900_000, False, 0),
        (3, None, law(60, 120), 1 << 40, [0], 1_000_000, True, 0),
    ]
    pastimes = [(4, 7, law(900, 7200), 0, 90_000)]
    return law(80_000, 86_000), 3600, jobs, pastimes, 0, 1


class OneRoom:
    """A home of one room with a seat, in which all ways take 7 us.

    Attributes:
        answers: What each method returns, if it is another value.
    """

    def __init__(self, **answers):
        seat = 300, 900, 7, 1, 300, 880
        spots = [(100, 500), (1000, 500)]
        self.answers = {
            "spots": spots, "seats": [0], "seat": seat, "nearest": 0, "room_at": 0, "wait": 0,
            "way_out": (100, 500),
        } | answers  # fmt: skip

    def __getattr__(self, name):
        return lambda *_: self.answers[name]


def walk(course, place):
    """Go to a place in 7 us, and stand there."""
    return (course[0][0] + 7, *place[1:], 0, 0), 0


def resident():
    return _core.Resident(KEY, 1000.0, 500.0, _core.Routes(MESH, corners()), [])


def small_moves():
    return [(kind, _core.Waits(np.array([100_000, 900_000]))) for kind in range(3)]


def room_use():
    """Return the uses of a bathroom."""
    use = _core.RoomUse()
    use.add(1, 30_000, 40_000)
    return use


def venue_of(activity):
    """Return the venue of an activity, on a spot or at furniture."""
    seats, takes = [0] * activity, ([0, 1], 0, 1, 0, 1)
    return _core.CoreVenue(None, activity, False, 0, 1, [0], seats, [0], small_moves(), takes)


def people():
    """Return the model of five people, a group and one more."""
    *arrays, first, detection = model()
    return StayModel(*(np.repeat(part[None], 5, axis=0) for part in arrays), first, detection)


def evidence():
    views = np.zeros((2, 4), np.uint8)
    views[1, 2] = 60
    user, view = np.array([0, 2, 2, 4]), np.array([0, 0, 1, 1, 1])
    columns = np.array([1, 0, 4, 2]), np.array([2, 1, 2, 0]), np.array([1, 2, 2, 3])
    return DayEvidence(np.arange(5), view, views, user, *columns)


def stretches():
    shown = np.array([[255, 0, 30, 0], [255, 0, 30, 0], [0, 0, 255, 0]], np.uint8)
    begin, patch = np.array([0, 1, 1, 2]), np.array([0, 2])
    return Stretches(np.array([1, 2, 1]), np.arange(3), shown, begin, patch, np.ones(2))


def traced_rooms():
    return TracedRooms(np.array([0.25, 0.75]), np.array([[0.0, 0.4], [0.4, 0.0]]))


def traced():
    seen, belief = np.array([[0.0, 1], [0, 0], [0.5, 0]]), np.full((3, 3), 1 / 3)
    day, minute = np.full(3, 739_000), np.array([5, 6, 7])
    return TracedEvidence(day, minute, 1 - seen, seen, np.zeros((3, 2), np.uint8), belief)


def moments():
    return Moments(np.zeros(3), np.zeros((3, 4)), np.zeros(4), np.zeros(3), np.zeros(3))


def moments_of_people():
    return Moments(*(np.repeat(part[None], 5, axis=0) for part in moments()))


def region(x=200, y=200):
    right, wall = _core.visible_region(MESH, x, y)
    return right, wall


def discs():
    """Return a body that stands."""
    return np.array([[500, 500, 100]])


def heights():
    """Return the heights of two cameras, of users and of a table."""
    corners = np.array([[320, 320], [384, 320], [384, 384]])
    boxes = np.array([[320, 320, 384, 384]])
    eyes, points = np.full((2, 3), 900), np.full((2, USERS, 3, 5), 1000)
    tops = np.full((USERS + 1, 3), 1700)
    return Heights(eyes, points, tops, corners, np.array([0, 3]), boxes, np.array([700]))


def corners():
    vertex = np.flatnonzero((MESH.vertices[:, 0] == 500) | (MESH.vertices[:, 0] == 640))
    place = MESH.vertices[vertex]
    return Corners(
        vertex, place + np.array([2, 0]), place + np.array([0, 2]), np.ones(len(vertex), bool)
    )


def timelines():
    result = _core.Timelines(2, SECOND)
    result.follow(0, 0, track(), np.array([5]), np.array([0, 1], np.int8))
    result.walk(1, 0, MESH, MESH, WalkRule(np.uint64(5), 9000, 40_000, 500), (100, 100, 0))
    return result


def kept(rows):
    numbers = np.full((rows, 2), 300)
    return Distances(numbers // 100, numbers, numbers, np.zeros((rows, 2), np.uint8))


CALLS = {
    "Mesh": lambda: (MESH.vertices, MESH.triangles, MESH.neighbors),
    "Mesh.with_neighbors": lambda: (MESH, MESH.neighbors),
    "locate": lambda: (MESH, 100, 100),
    "orient": lambda: (1, 2, 3, 4, 5, 7),
    "contains_triangle": lambda: (MESH, 0, 100, 100),
    "strictly_inside": lambda: (MESH, 100, 100),
    "rasterize_cells": lambda: (MESH, HOME.rows, HOME.columns),
    "label_triangles": lambda: (MESH.neighbors,),
    "half_sine": lambda: (5000,),
    "sine": lambda: (5000,),
    "cosine": lambda: (5000,),
    "heading_of": lambda: (300, -4),
    "turn_between": lambda: (4000, 100),
    "random_bits": lambda: (KEY, 4),
    "random_below": lambda: (KEY, 4, 100),
    "random_uniform": lambda: (KEY, 4),
    "random_bell": lambda: (KEY, 4),
    "random_bells": lambda: (KEY, np.arange(5)),
    "hides": lambda: (300, 40, 150, 30, 60),
    "near_wedge": lambda: (100, 300, 50, 60, 20),
    "in_wedge": lambda: (100, 300, 50, 60),
    "camera_pose": lambda: (lenses(), 1, 100, 100, 5, SECOND),
    "points_in_view": lambda: (MESH, lenses(), 0, 1, 100, 100, 5, 70, 30),
    "line_of_sight": lambda: (MESH, 100, 100, 0, 300, 900),
    "nearest_cells_in_sight": lambda: (MESH, MASK, 100, 100, 300, 9, 3),
    "build_fans": lambda: (MESH,),
    "vertices_seen_from_point": lambda: (MESH, 100, 100),
    "vertices_seen_from_vertex": lambda: (MESH, 3),
    "pairs_in_sight": lambda: (MESH, POINTS, POINTS[::-1]),
    "label_frames": lambda: (np.array([[0, 1, -1], [2, 0, -1]], np.int32), 3),
    "fill_from_neighbors": lambda: (np.array([[0, 1, -1], [2, 0, -1]], np.int16),),
    "spread_labels": lambda: (np.where(MASK, 1, -1).astype(np.int32), MASK),
    "label_parts": lambda: (MASK, True),
    "count_steps": lambda: (MASK, MASK),
    "trace_rings": lambda: (MASK,),
    "squared_distance": lambda: (MASK,),
    "corner_sums": lambda: (MASK,),
    "group_places": lambda: (floor(), ~MASK, GroupRule(1, 1, 1, 0, 40, 20, 3)),
    "squarest_rooms": lambda: (
        Divisions(np.array([[-2, 2], [0, 100], [1, 60]]), np.zeros(1, np.int64)),
        AREAS,
        np.array([0, 0, 90, 60]),
        np.array([[0, 0, 0, 20]]),
    ),
    "move_walls": lambda: (np.array([[0, 0], [90, 0], [90, 60], [0, 60]]), 9, 4),
    "wall_obstacles": lambda: (
        np.array([[0, 0], [90, 0], [90, 60], [0, 0]]),
        np.zeros(4, np.int64),
        9,
        4,
    ),
    "add_obstacles": lambda: (
        _core.wall_obstacles(np.array([[0, 0], [90, 0]]), np.zeros(2, np.int64), 9, 4),
        np.array([[10, 0, 50, 30]]),
        9,
        4,
    ),
    "is_promising": lambda: (np.array([[0, 0, 0, 60, 50]]), LIMITS),
    "strip_rooms": lambda: (SLOTS, AREAS, 100, 20, 240),
    "row_rooms": lambda: (SLOTS, AREAS, CorridorRule(2, 24, 0, -1), 100, 20, 240),
    "wing_rooms": lambda: (*WING, CorridorRule(2, 24, 1, 1), 60, 44, 124),
    "squarest_depth": lambda: (
        *WING,
        CorridorRule(2, 24, 0, -1),
        np.array([56, 90]),
        44,
        124,
        LIMITS,
    ),
    "box_sums": lambda: (COSTS.astype(np.int64), 1),
    "climb": lambda: (np.where(MASK, 1, -1).astype(np.int32), MASK.astype(np.int64)),
    "walking_distance": lambda: (MASK, np.array([[0, 0], [2, 3]])),
    "cheapest_cells": lambda: (COSTS, (2, 3), (0, 0)),
    "step_cost": lambda: (COSTS, 0, 0, 0, 1),
    "leg_cost": lambda: (COSTS, 5, 5, 200, 150),
    "pull_taut": lambda: (
        MESH,
        COSTS,
        np.array([[10, 10], [60, 60], [60, 150], [200, 150]]),
    ),
    "visible_region": lambda: (MESH, 200, 200),
    "region_contains": lambda: (MESH, 200, 200, *region(), 210, 300),
    "region_contains_points": lambda: (MESH, 200, 200, *region(), POINTS),
    "regions_of_cells": lambda: (
        MESH,
        np.array([[1, 1], [2, 5]]),
        _core.rasterize_cells(MESH, HOME.rows, HOME.columns),
    ),
    "region_outline": lambda: (MESH, 200, 200, *region()),
    "cells_in_view": lambda: (MESH, 200, 200, 5, Reach(0, 90_000, 800), HOME.rows, HOME.columns),
    "mark_spans": lambda: (np.array([[0, 1, 3], [2, 0, 0]], np.int32), MASK | False),
    "record_coverage": lambda: (setup(), window(), 0, 0, STEPS, empty_pose_cache(8, 2), record()),
    "settle_coverage": lambda: (setup(), empty_pose_cache(8, 2), record().last),
    "trace_track": lambda: (track(), 0, SECOND, poses()),
    "charge_pieces": lambda: (track(), battery()),
    "charge_at": lambda: (track(), battery(), 3 * SECOND),
    "charge_falls_to": lambda: (track(), battery(), 0.1),
    "remember": lambda: (
        np.array([5, 7]),
        np.array([1, 0], np.int32),
        np.array([0, -1]),
        np.array([1, -1], np.int16),
        0,
        SECOND,
        memory(),
    ),
    "show_memory": lambda: (
        memory(),
        ShownMemory(*(np.array([0, 1]) for _ in range(2)), np.ones(2), *np.ones((2, 2), np.int64)),
        np.array([-1, 5]),
        9,
        7,
        1.0,
        [0.5],
        np.zeros((3, 4), np.float32),
    ),
    "time_route": lambda: (POINTS[:2], 5, 7, 1000.0, 500.0),
    "trace_meander": lambda: (
        MESH,
        MESH,
        WalkRule(np.uint64(5), 9000, 40_000, 500),
        3,
        (100, 100, 0),
        poses(),
    ),
    "due_rows": lambda: (np.array([5, 9, 5]), 5),
    "rooms_at": lambda: (
        np.zeros((3, 4), np.int16),
        np.array([5, 200, -9]),
        np.array([5, 2**40, 7]),
    ),
    "count_together": lambda: (
        np.array([0, 2]),
        np.array([1, -1], np.int16),
        np.array([0, 3]),
        np.array([1, 0], np.int16),
        5,
    ),
    "sum_moves": lambda: (poses(), np.array([[0, 0, 90, 90, 5]])),
    "distances_between": lambda: (window(), 0, 1),
    "distances_to_shape": lambda: (window(), 0, np.array([[0, 0, 9, 0], [9, 0, 0, 9]])),
    "speeds": lambda: (window(), 0, np.array([5, 5, 0]), np.array([[0, 0, 90, 90, 5]])),
    "sliding_max": lambda: (*signal(), 9, -1, 4, 0.0, 1.0),
    "until": lambda: (*signal(), np.array([0.5, 2.0, -1.0]), 0.0),
    "points_in_sight": lambda: (MESH, 100, 100, POINTS),
    "points_near": lambda: (POINTS, POINTS[:3], 500.0),
    "best_view": lambda: (MESH, POINTS, POINTS, 90_000.0, np.eye(2), 0.5),
    "points_in_reach": lambda: (100, 100, 5, Reach(0, 90_000, 800), POINTS),
    "view_queries": lambda: (
        lenses(),
        lenses().widest,
        20,
        poses(),
        *(np.arange(2 * STEPS).reshape(2, STEPS) * 9 for _ in "xy"),
        np.zeros((2, STEPS), np.uint8),
        0,
        SECOND,
    ),
    "random_share": lambda: (KEY, 4),
    "random_shares": lambda: (KEY, np.arange(5)),
    "pick": lambda: (np.array([5, 9, 2**31]), 7),
    "length": lambda: (300, 40),
    "distance_bin": lambda: (errors().table, 0, 300, 40),
    "persistence_chance": lambda: (errors().table, 0, 7),
    "steady_chance": lambda: (errors().table, 0, 5, 300, 40, 70, 1, 3),
    "notice_chance": lambda: (2**30, 2**30, 2**52),
    "turn_and_stretch": lambda: (300, 40, 50, 302, 400),
    "perceived_offset": lambda: (errors().table, errors().keys, 0, 1, 5, 300, 40),
    "perceived_posture": lambda: (errors().table, 0, 1, 2**30),
    "detect": lambda: (
        MESH,
        lenses(),
        errors(),
        DetectionRule(5, SECOND, 0, 60, False, True),
        window(),
        0,
        1,
        new_memory(2, USERS, 200),
        np.ones((2, USERS, STEPS), np.uint64),
        np.full(USERS + 1, 60),
        heights(),
    ),
    "Routes": lambda: (MESH, corners()),
    "Routes.find": lambda: (_core.Routes(MESH, corners()), 100, 500, 1000, 500),
    "Routes.around": lambda: (_core.Routes(MESH, corners()), 100, 500, 1000, 500, discs()),
    "place_beside": lambda: (
        np.zeros((20, 20), np.int32),
        0,
        np.zeros((20, 20), np.int16),
        -1,
        (100, 100),
        (50, 60),
        200,
        discs(),
    ),
    "distance": lambda: (1, 2, 3, 4),
    "advance": lambda: (np.array([0.5, 0.5]), np.array([[0.9, 0.1], [0.3, 0.7]]), 5),
    "DayPlanner": day_plan,
    "DayPlanner.plan": lambda: (
        _core.DayPlanner(*day_plan()),
        _core.StepDraws(7, 3),
        25_000,
        110_000,
        room_use(),
        [[1, 2], []],
    ),
    "DayPlanner.draw_order": lambda: (
        _core.DayPlanner(*day_plan()),
        _core.StepDraws(7, 3),
        [True, True],
        25_000,
        110_000,
        False,
    ),
    "RoomUse": lambda: (),
    "RoomUse.add": lambda: (_core.RoomUse(), 1, 30_000, 40_000),
    "RoomUse.free": lambda: (room_use(), [1, 2], 25_000, 60_000, 600, 90_000),
    "Interruptions": needs_and_errands,
    "Interruptions.interrupt": lambda: (
        _core.Interruptions(*needs_and_errands()),
        _core.StepDraws(7, 3),
        [(0, 0, 30_000, -1), (1, 30_000, 60_000, 1), (2, 60_000, 90_000, -1)],
        room_use(),
        [[1], [], [], []],
    ),
    "list_sightings": lambda: (
        np.arange(6),
        np.array([0, 1, 2, 3, 0, 3], np.int32),
        np.array([0, 1, -1, 0]),
        np.array([0, -1, 2, 1]),
        3,
        2,
        3,
        3,
    ),
    "earth_mover": lambda: (
        np.array([[0.5, 0.25, 0.25], [1.0, 0.0, 0.0]]),
        np.array([[0.25, 0.25, 0.5], [0.0, 0.5, 0.5]]),
        np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 1.5], [2.0, 1.5, 0.0]]),
    ),
    "resampled": lambda: (KEY, np.arange(12.0).reshape(4, 3), 5),
    "gather_views": lambda: (
        np.ones((3, 2, 2, 4), np.int64),
        np.array([0, 0, 1, 2]),
        np.full(4, 5),
        np.array([10, 5, 5]),
        7,
    ),
    "watched_views": lambda: (
        np.array([[9, 0, 7], [9, 0, 7], [0, 8, 0]], np.uint8),
        np.array([0, 1, 1, 2, 2]),
        np.array([0, 1, 2, 0, 2]),
        np.array([0, 2, 1, 0, 1]),
        np.array([5, 3, 2, 6, 2]),
        3,
    ),
    "sum_places": lambda: (
        (np.full((5, 3), 0.3), np.array([5, 1, 1, 3, 2]), np.array([0, 2, 5])),
        np.zeros((6, 2), bool),
        2,
        np.array([0, 4]),
    ),
    "encode_arrays": lambda: ([np.arange(3), np.zeros(2, bool)],),
    "merge_bins": lambda: (
        np.arange(5),
        np.zeros(5, np.int64),
        np.arange(3),
        np.arange(3),
        np.ones(3, np.int64),
        4,
    ),
    "follow": lambda: (model(), stretches(), np.full((2, 1, 4), 0.125), np.full(4, -1)),
    "smooth": lambda: (model(), stretches(), np.full((1, 4), 0.25), np.ones((1, 4)), moments()),
    "follow_people": lambda: (people(), evidence(), 2, np.full((5, 1, 4), 0.25)),
    "trace_size": lambda: (traced_rooms(),),
    "trace_evidence": lambda: (np.zeros(trace_size(traced_rooms())), traced_rooms(), traced()),
    "place_probabilities": lambda: (
        PlaceNetwork(np.ones((4, 3)), np.ones((3, 3)), np.ones((3, 3)), np.ones(3), np.ones(3)),
        np.zeros((2, 3)),
        np.ones((5, 2, 4)),
    ),
    "smooth_people": lambda: (
        people(),
        evidence(),
        2,
        np.full((5, 1, 4), 0.25),
        np.ones((5, 1, 4)),
        moments_of_people(),
    ),
    "learned_stays": lambda: (
        moments_of_people(),
        np.array([120.0]),
        np.full(4, 0.5),
        np.ones(3),
        np.array([0, 1, 3, 4]),
        0.05,
    ),
    "Window": lambda: (
        0,
        *(np.arange(6).reshape(2, 3) for _ in range(3)),
        np.zeros((2, 3), np.uint8),
        np.zeros((2, 3), np.int8),
    ),
    "Window.dense": lambda: (window(), 1, 2, 7),
    "Legs": lambda: (),
    "Legs.mark": lambda: (_core.Legs(), 5, 100, 100, 7, 0),
    "Legs.add": lambda: (_core.Legs(), np.array([[5, 1, 2, 3, 0], [9, 1, 2, 3, 1]])),
    "Legs.turn": lambda: (_core.Legs(), 5, 100, 100, 7, 0, 300, 500.0),
    "Legs.walk": lambda: (_core.Legs(), 5, 7, POINTS[:2], 1000.0, 500.0),
    "Legs.go": lambda: (
        _core.Legs(),
        5,
        100,
        500,
        7,
        _core.Routes(MESH, corners()),
        1000,
        500,
        1000.0,
        500.0,
    ),
    "Legs.visit": lambda: (
        _core.Legs(),
        5,
        100,
        500,
        7,
        _core.Routes(MESH, corners()),
        np.array([[1000, 500], [100, 500]]),
        1000.0,
        500.0,
        4096,
        60_000_000,
    ),
    "Legs.settle": lambda: (_core.Legs(), 5, 100, 100, 7, 300, 200, 9, 1000.0, 500.0),
    "Legs.rows": lambda: (_core.Legs(),),
    "Legs.track": lambda: (_core.Legs(),),
    "Waits": lambda: (np.array([100, 200, 300, 400]),),
    "CoreVenue": lambda: (
        None,
        3,
        False,
        2,
        1,
        [0, 1],
        [],
        [1],
        small_moves(),
        ([5, 9], 5, 9, 0, 1),
    ),
    "LastStint": lambda: (),
    "Resident": lambda: (KEY, 1000.0, 500.0, _core.Routes(MESH, corners()), [(9, 9, 100, 500)]),
    "Resident.live": lambda: (
        resident(),
        OneRoom(),
        walk,
        _core.Legs(),
        (5, 100, 500, 7, 0),
        0,
        [(venue_of(activity), activity, SECOND, 0, False) for activity in range(2)],
        3 * SECOND,
        False,
        _core.LastStint(),
    ),
    "Resident.go": lambda: (
        resident(),
        OneRoom(),
        walk,
        _core.Legs(),
        (5, 100, 500, 7, 1),
        0,
        venue_of(1),
        _core.StepDraws(7, 3),
    ),
    "StepDraws": lambda: (KEY, 4),
    "StepDraws.below": lambda: (_core.StepDraws(KEY, 4), 100),
    "StepDraws.uniform": lambda: (_core.StepDraws(KEY, 4),),
    "Bits": lambda: (_core.StepDraws(KEY, 4),),
    "Bits.take": lambda: (_core.Bits(_core.StepDraws(KEY, 4)), 8),
    "Timelines": lambda: (3, SECOND),
    "Timelines.follow": lambda: (
        timelines(),
        0,
        3,
        track(),
        np.array([5, 9]),
        np.array([0, 1, 2], np.int8),
    ),
    "Timelines.walk": lambda: (
        timelines(),
        0,
        3,
        MESH,
        MESH,
        WalkRule(np.uint64(5), 9000, 40_000, 500),
        (100, 100, 0),
    ),
    "Timelines.pose": lambda: (timelines(), 1, 7),
    "Timelines.poses": lambda: (timelines(), np.array([7, 2])),
    "Timelines.window": lambda: (timelines(), 2, 7),
    "Timelines.runs": lambda: (timelines(), 1, 2, 7),
    "Timelines.forget": lambda: (timelines(), 3),
    "Timelines.meetings": lambda: (timelines(), np.array([0, 1]), kept(2), 3, 9),
    "Timelines.meeting_on": lambda: (timelines(), 0, track(), kept(1), 3, 9),
    "Timelines.meeting_at_rest": lambda: (timelines(), 0, kept(1), 3, 9),
    "Timelines.rests": lambda: (timelines(), 0, 3, 9),
    "Timelines.standing": lambda: (timelines(), 0, 3, 2, np.array([300, 300])),
    "Timelines.way_after_a_wait": lambda: (timelines(), 0, 3, np.array([1, 2]), kept(1), 9),
    "Timelines.way_by_a_place": lambda: (
        timelines(),
        (0, MESH, None, 1000.0, 500.0, 10**6, lambda *_: None),
        3,
        4,
        POINTS[:2],
        np.array([1, 2]),
        2,
        kept(1),
        9,
    ),
    "Timelines.way_past": lambda: (
        timelines(),
        (0, MESH, None, 1000.0, 500.0, 10**6, lambda *_: None),
        3,
        4,
        (0, 100, 300, np.zeros((20, 20), np.int16), lambda *_: 0, 0),
        np.array([1, 2]),
        kept(1),
        9,
    ),
    "Timelines.way_aside": lambda: (
        timelines(),
        (0, MESH, None, 1000.0, 500.0, 10**6, lambda *_: None),
        3,
        4,
        (np.zeros((20, 20), np.int32), 0, lambda: (100, 100), 3, 5, 2, 3, np.array([0, 300])),
        np.array([1, 2]),
        2,
        kept(1),
        9,
    ),
    "Timelines.takes_stop": lambda: (timelines(), 0, MESH, 3, 4, 1, 300, 9),
    "Timelines.way_round": lambda: (
        timelines(),
        (0, MESH, None, 1000.0, 500.0, 10**6, lambda *_: None),
        3,
        4 * 10**6,
        np.array([[300, 300, 100]]),
        lambda *_: None,
    ),
    "Timelines.way_from_here": lambda: (
        timelines(),
        (0, MESH, None, 1000.0, 500.0, 10**6, lambda *_: None),
        3,
        4 * 10**6,
        lambda *_: True,
    ),
    "Timelines.places_aside": lambda: (
        timelines(),
        0,
        3,
        9,
        np.zeros((20, 20), np.int32),
        0,
        (100, 100),
        (5, 2, 3),
        np.array([0, 300]),
    ),
    "next_stop": lambda: (MESH, track(), 5),
}


def named(name):
    """Return a function, class or method of the core."""
    result = _core
    for part in name.split("."):
        result = getattr(result, part)
    return result


def leaves(value, kind, at=()):
    """Yield where in nested tuples values of a kind are."""
    if isinstance(value, tuple | list):
        for i, part in enumerate(value):
            yield from leaves(part, kind, (*at, i))
    elif isinstance(value, kind) and not isinstance(value, bool):
        yield at


def leaf(value, at):
    """Return the value at a place in nested tuples."""
    for i in at:
        value = value[i]
    return value


def put(value, at, new):
    """Return nested tuples with another value at a place."""
    if not at:
        return new
    parts_ = [put(part, at[1:], new) if i == at[0] else part for i, part in enumerate(value)]
    return type(value)(*parts_) if hasattr(value, "_fields") else type(value)(parts_)
