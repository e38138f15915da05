"""The picture of a run: drawn for every kind of run, deterministic, and true to what was stored."""

import json
import re
from datetime import datetime
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.scenes import flat_path
from tests.thorough import some

import fleet2d
from fleet2d import Run, Simulation, open_run
from fleet2d.errors import ArtifactError, InputError
from fleet2d.runs.run import FLOORPLAN_NAME
from fleet2d.runtime.local_time import zone_of

pytest.importorskip("matplotlib")

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Polygon
from matplotlib.text import Text

from fleet2d.palette import deep_color
from fleet2d.sight.fov import VisibleRegion
from fleet2d.viewing.pictures.life import BodyTrace, best_view, field_of_view, opacity, trace_of
from fleet2d.viewing.pictures.run import (
    MARK_PART,
    MIN_MARK_HEIGHT,
    NOT_SIMULATED,
    draw_actogram,
    draw_run,
    hours_shown,
    mark_boxes,
    marks_by_day,
    rooms_by_day,
    run_figure,
)

MEANDER = {"type": "meander"}
START = datetime(2026, 1, 5)


@cache
def two_days() -> Run:
    """The paper's scenario for two days."""
    return base()


def base(*overrides: str, **settings: Any) -> Run:
    """Run the paper's scenario for two days."""
    return fleet2d.run("bundled:paper", "simulation.duration=2 d", *overrides, **settings)


def words_in(svg: Path) -> str:
    """Return the words of a picture: matplotlib leaves them in comments."""
    return "\n".join(line for line in svg.read_text().splitlines() if "<!--" in line)


def words_of(run: Run) -> str:
    """Return the words of the picture of a run, without writing it to a file."""
    return "\n".join(text.get_text() for text in run_figure(run).findobj(Text))


def words_drawn(run: Run, tmp_path: Path) -> str:
    """Draw a run; return the words in the picture."""
    draw_run(run, tmp_path / "run.svg")
    return words_in(tmp_path / "run.svg")


@pytest.mark.slow
@pytest.mark.parametrize("ending", some(["png", "svg"], 2))
def test_same_run_gives_same_bytes(tmp_path, ending):
    run = base(out=tmp_path / "run")
    picture, repeated = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
    draw_run(run, picture)
    draw_run(open_run(tmp_path / "run"), repeated)
    assert picture.read_bytes() == repeated.read_bytes()
    assert [] == list(tmp_path.glob("*.partial"))


def test_picture_says_what_was_run(tmp_path):
    run = two_days()
    assert run.digest is not None
    words = words_drawn(run, tmp_path)
    for fact in (
        "paper",
        "2 days in family_home",
        "seed 4",
        run.digest[:12],
        "ana",
        "astro",
        "away",
    ):
        assert fact in words
    assert "interrupted" not in words


@pytest.mark.slow
@pytest.mark.parametrize(
    ("users", "robots"), [({}, None), (None, {}), ({}, {}), ({"bo": MEANDER}, {"eye": MEANDER})]
)
def test_run_without_users_or_robots_is_drawn(tmp_path, users, robots):
    scenario = fleet2d.load_scenario("bundled:paper", "simulation.duration=3 h").resolved()
    scenario["users"] = scenario["users"] if users is None else users
    scenario["robots"] = scenario["robots"] if robots is None else robots
    words = words_drawn(fleet2d.run(scenario), tmp_path)
    for name in (*scenario["users"], *scenario["robots"]):
        assert name in words


@pytest.mark.parametrize(
    ("override", "note"),
    [
        ("artifacts.key_frames=false", "no key frames were stored: positions every 1 h"),
        ("artifacts={key_frames: false, trajectories: off}", "where users were is not stored"),
        ("artifacts={observations: false, events: false, outputs: false}", "ana"),
    ],
)
def test_run_that_stored_less_says_so(override, note):
    assert note in words_of(base(override))


@pytest.mark.slow
@pytest.mark.parametrize(
    "overrides",
    some(
        [
            ("simulation.duration=1 s",),
            ("simulation.duration=5 s", "simulation.start=2026-01-05T23:59:58"),
            ("simulation.duration=2 h", "simulation.start=2026-01-05T10:40"),
            ("simulation.step=2 h", "artifacts.trajectories=off", "simulation.duration=3 d"),
            ("simulation.duration=40 d", "robots={}", "metrics={}"),
        ],
        2,
    ),
)
def test_short_and_long_runs_are_drawn(tmp_path, overrides):
    assert "ana" in words_drawn(fleet2d.run("bundled:rounds", *overrides), tmp_path)


def test_of_many_users_four_are_shown_and_the_rest_counted():
    users = {f"person_{number:02d}": MEANDER for number in range(50)}
    run = fleet2d.run(
        {
            "simulation": {"duration": "30 min", "seed": 1},
            "floorplan": {"type": "bundled"},
            "users": users,
        }
    )
    words = words_of(run)
    assert "4 of 50 users are shown" in words
    assert "person_03" in words
    assert "person_04" not in words


@pytest.mark.slow
def test_interrupted_run_is_drawn_and_marked(tmp_path):
    simulation = Simulation("bundled:paper", "simulation.duration=2 d")
    simulation.advance(100_000)
    assert "interrupted" in words_drawn(simulation.finish(), tmp_path)


def test_run_that_simulated_nothing_is_drawn(tmp_path):
    words = words_drawn(Simulation("bundled:paper").finish(), tmp_path)
    assert "0 s in family_home" in words


def test_run_that_lost_its_floor_plan_says_so(tmp_path):
    base(out=tmp_path / "run")
    (tmp_path / "run" / FLOORPLAN_NAME).unlink()
    with pytest.raises(ArtifactError, match=f"{FLOORPLAN_NAME} is missing"):
        draw_run(open_run(tmp_path / "run"), tmp_path / "a.png")


def test_picture_of_another_kind_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"written as \.png, \.svg or"):
        draw_run(two_days(), tmp_path / "run.jpg")


def test_colour_that_is_given_is_used(tmp_path):
    run = base("users.ana.color=teal", "robots.astro.color=no colour")
    ana = trace_of(run, run.plan, "ana", 0, robot=False)
    astro = trace_of(run, run.plan, "astro", 0, robot=True)
    assert ana is not None
    assert astro is not None
    assert "teal" == ana.color
    assert astro.color.startswith("#")


def test_areas_that_a_robot_keeps_out_of_are_hatched_and_named():
    corners = [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]
    run = base(f"robots.astro.keep_out=[{{area: {corners}, during: '22:00-07:00'}}]")
    hatched = [
        patch.get_xy().tolist()[:3]
        for axes in run_figure(run).axes
        for patch in axes.patches
        if isinstance(patch, Polygon) and patch.get_hatch()
    ]
    assert corners in hatched
    assert "astro keeps out" in words_of(run)
    assert "keeps out" not in words_of(base())


def test_actogram_has_the_rooms_of_every_minute():
    run = base("simulation.start=2026-01-09T10:30", "artifacts.trajectories=4 s")
    ana = trace_of(run, run.plan, "ana", 0, robot=False)
    assert ana is not None
    start = datetime.fromisoformat(run.manifest["start"])
    rooms = rooms_by_day(ana, start, 1_000_000, run.manifest["steps"])
    table = run.pandas("trajectories")
    truth = table[table["entity"] == "ana"]["room"].cat.codes.to_numpy()
    # A minute has the colour of its middle; the run is sampled every 4 s.
    middles = np.arange(30, 2 * 86_400, 60) // 4
    assert truth[middles].tolist() == rooms.ravel()[10 * 60 + 30 :][: len(middles)].tolist()
    assert (3, 1440) == rooms.shape
    assert {NOT_SIMULATED} == set(rooms[0, : 10 * 60 + 30].tolist())
    assert {NOT_SIMULATED} == set(rooms[2, 10 * 60 + 30 :].tolist())
    assert (0.0, 24.0) == hours_shown(rooms)


def test_marks_are_the_share_of_five_minutes_that_the_user_was_seen():
    seen = np.array([0, 299, 300, 300, *range(600, 900), 86_399, 86_400])  # 300 by two robots
    marks = marks_by_day(seen, START, 1_000_000, 2)
    cells = np.argwhere(marks > 0).tolist()
    assert [[0, 0], [0, 1], [0, 2], [0, 287], [1, 0]] == cells
    assert [2, 1, 300, 1, 1] == np.rint(marks[marks > 0] * 300).astype(int).tolist()


def test_a_step_longer_than_a_mark_fills_as_many_marks_as_it_lasts():
    half_past = START.replace(hour=10, minute=32, second=30)
    marks = marks_by_day(np.array([0]), half_past, 600_000_000, 1)
    assert [126, 127, 128] == np.flatnonzero(marks[0]).tolist()
    assert [0.5, 1.0, 0.5] == marks[0, 126:129].tolist()


def test_no_sightings_leave_no_marks():
    marks = marks_by_day(np.zeros(0, np.int64), START, 1_000_000, 3)
    assert (3, 288) == marks.shape
    assert 0 == len(mark_boxes(marks))


@pytest.mark.parametrize(
    ("noon", "expected"),
    [
        # Minutes of the night, and the hours since noon: what is read twice is drawn once.
        (datetime(2026, 10, 24, 12), {150: 14, 179: 14, 180: 16, 1439: 36}),
        # What is never read is left out.
        (datetime(2026, 3, 28, 12), {119: 13, 120: -2, 179: -2, 180: 14, 1439: 34}),
    ],
)
def test_day_is_drawn_by_what_the_clock_reads(noon, expected):
    zone = zone_of("Europe/Berlin", noon, noon)
    hours: Any = SimpleNamespace(room=np.arange(50), every_us=3_600_000_000)
    rooms = rooms_by_day(hours, zone.at(noon), 60_000_000, 50 * 60)

    assert 3 == len(rooms)
    assert expected == {minute: int(rooms[1, minute]) for minute in expected}
    marks = marks_by_day(np.arange(50 * 60), zone.at(noon), 60_000_000, 3)
    is_read = rooms.reshape(3, -1, 5)[..., 0] >= 0
    assert is_read.tolist() == (marks > 0).tolist()
    assert marks.max() <= 1


def test_ink_of_the_marks_is_in_proportion_to_the_time_seen():
    often = np.flatnonzero(np.arange(2 * 86_400) % 3_600 < 1_200)
    seldom = np.flatnonzero(np.arange(2 * 86_400) % 3_600 < 30)
    always = np.arange(2 * 86_400)
    ink = {}
    for seen in (seldom, often, always):
        boxes = mark_boxes(marks_by_day(seen, START, 1_000_000, 2))
        ink[len(seen)] = float(np.ptp(boxes, axis=1).prod(axis=1).sum())
    full = ink[len(always)]
    assert full == pytest.approx(48 * MARK_PART)
    assert ink[len(often)] / full == pytest.approx(1 / 3)
    assert ink[len(seldom)] / full == pytest.approx(30 / 3_600)


def test_a_single_sighting_has_a_mark_of_the_least_height_in_its_row():
    (box,) = mark_boxes(marks_by_day(np.array([86_400 + 43_200]), START, 1_000_000, 3), 0.1)
    assert [12.0, 12.0 + 1 / 12] == pytest.approx([box[:, 0].min(), box[:, 0].max()])
    assert [1.9 - MARK_PART * MIN_MARK_HEIGHT, 1.9] == pytest.approx(
        [box[:, 1].min(), box[:, 1].max()]
    )


def test_ink_in_the_picture_is_in_proportion_too():
    def darkness(share: float) -> float:
        figure = Figure(figsize=(4, 4), dpi=150)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        plan = fleet2d.load_floorplan()
        rooms = np.full((30, 1440), -1, np.int16)
        marks = np.zeros((30, 288))
        marks[:, ::4] = share
        draw_actogram(plan, rooms, marks, START, axes, dates=False)
        canvas.draw()
        return float(255 - np.asarray(canvas.buffer_rgba())[..., :3].mean())

    empty = darkness(0.0)
    tenth, half, full = (darkness(share) - empty for share in (0.1, 0.5, 1.0))
    assert full > 5
    assert [0.1, 0.5] == pytest.approx([tenth / full, half / full], rel=0.1)


def test_presence_everywhere_is_a_faint_tint_and_a_bed_is_no_blot():
    free = np.zeros((40, 40), np.bool_)
    free[2:38, 2:38] = True
    uniform = opacity(free * 7.0, free)
    assert uniform[free].max() == pytest.approx(uniform[free].min())
    assert 0.05 < uniform[20, 20] < 0.12
    in_bed = free * 0.01
    in_bed[5, 5] = 1e6
    assert 0.3 < opacity(in_bed, free).max() <= 0.4
    assert 0 == opacity(np.zeros((3, 3)), np.ones((3, 3), np.bool_)).max()


@pytest.mark.slow
def test_each_user_has_a_line_in_the_legend():
    scenario = fleet2d.load_scenario("bundled:paper", "simulation.duration=3 h").resolved()
    scenario["users"] = dict.fromkeys(("ana", "bo", "cleo"), MEANDER)
    words = words_of(fleet2d.run(scenario))
    assert all(f"ways of {name}" in words for name in ("ana", "bo", "cleo"))
    assert "ways walked" in words_of(two_days())


@pytest.mark.slow
def test_too_many_rings_are_left_out_with_a_note():
    few = words_of(two_days())
    assert "seen here by a robot" in few
    assert "are not drawn" not in few
    scenario = fleet2d.load_scenario("bundled:paper", "simulation.duration=4 d").resolved()
    scenario["users"] = {"ana": MEANDER}
    many = words_of(fleet2d.run(scenario))
    assert "seen here by a robot" not in many
    assert "places where robots saw users are not drawn" in many


def saved_plan(path: Path, width: float, height: float) -> dict[str, str]:
    """Store a rectangular home as HouseExpo does; return the part of a scenario that names it."""
    corners = [[0, 0], [width, 0], [width, height], [0, height], [0, 0]]
    home = {
        "id": path.stem,
        "room_num": 0,
        "bbox": {"min": [0, 0], "max": [width, height]},
        "verts": corners,
        "room_category": {},
    }
    path.write_text(json.dumps(home))
    return {"type": "houseexpo", "path": str(path)}


@pytest.mark.parametrize("size", [(1.9, 1.6), (6.0, 5.0), (30.0, 25.0), (25.0, 3.0), (3.0, 25.0)])
def test_words_of_the_scale_are_above_the_legend(tmp_path, monkeypatch, size):
    run = fleet2d.run(
        {
            "simulation": {"duration": "30 min", "seed": 1},
            "floorplan": saved_plan(tmp_path / "home.json", *size),
            "users": {"ana": {**MEANDER, "radius": 0.2}},
        }
    )
    figures: list[Figure] = []
    monkeypatch.setattr(
        "fleet2d.viewing.pictures.floorplan.save_figure", lambda figure, _: figures.append(figure)
    )
    draw_run(run, tmp_path / "run.png")
    texts = [text for axes in figures[0].axes for text in axes.texts]
    boxes = {text.get_text(): text.get_window_extent() for text in texts}
    (scale,) = (box for words, box in boxes.items() if re.fullmatch(r"\d+ m", words))
    assert scale.y0 > boxes["ways walked"].y1 + 3


@pytest.mark.slow
def test_picture_of_a_narrow_home_is_narrower(tmp_path):
    widths = []
    for number, size in enumerate([(10.0, 9.0), (5.0, 20.0)]):
        scenario = {
            "simulation": {"duration": "30 min", "seed": 1},
            "floorplan": saved_plan(tmp_path / f"{number}.json", *size),
            "users": {"ana": MEANDER},
        }
        draw_run(fleet2d.run(scenario), tmp_path / "run.png")
        widths.append(imread(tmp_path / "run.png").shape[1])
    assert 1600 == widths[0]
    assert widths[1] < 1400


def test_hash_that_names_a_plan_is_shortened(tmp_path):
    scenario = {
        "simulation": {"duration": "30 min", "seed": 1},
        "floorplan": saved_plan(tmp_path / f"{'2deaa98e' * 4}.json", 5, 4),
        "users": {"ana": MEANDER},
    }
    words = words_of(fleet2d.run(scenario))
    assert "30 minutes in 2deaa98e…" in words
    assert "2deaa98e2" not in words


def test_rooms_in_the_actogram_are_a_deeper_shade_of_the_plan():
    plan = fleet2d.load_floorplan()
    colors = {room.type: to_rgb(deep_color(room.type)) for room in plan.rooms}
    assert all(0 <= part <= 1 for color in colors.values() for part in color)
    assert colors["kitchen"] != colors["living_room"] != colors["dining_room"]


def test_ways_are_not_drawn_across_an_absence_nor_through_walls():
    run = two_days()
    ana = trace_of(run, run.plan, "ana", 0, robot=False)
    assert ana is not None
    assert len(ana.legs) > 10
    along = np.linspace(0.02, 0.98, 25)[:, None]
    for start, end in ana.legs:
        points = start + along * (end - start)
        assert VisibleRegion(run.plan, *points[0].tolist()).contains(points[1:]).all()


def test_a_way_on_which_a_robot_brakes_is_drawn_as_one_line():
    def legs(drive: str) -> Any:
        robot = {"type": "patrol", "waypoints": [[1, 3], [7, 1], [7, 6]], "dwell": "1 s"}
        content = {
            "simulation": {"duration": "3 min"},
            "floorplan": {"type": "native", "path": str(flat_path())},
            "robots": {"astro": {**robot, "start": [1, 3], "drive": drive}},
        }
        run = fleet2d.run(content)
        trace = trace_of(run, run.plan, "astro", 0, robot=True)
        assert trace is not None
        return trace.legs

    usual, other = legs("differential"), legs("trapezoidal")
    assert other[:7] == pytest.approx(usual[:7], abs=0.002)  # a round


def test_field_of_view_is_what_is_visible_in_range_and_angle():
    run = two_days()
    camera = run.manifest["scenario"]["robots"]["astro"]["camera"]
    astro = trace_of(run, run.plan, "astro", 0, robot=True)
    assert isinstance(astro, BodyTrace)
    view = best_view(run.plan, astro, camera, np.zeros(0, np.int64), np.zeros((0, 2)))
    assert view is not None
    outline = field_of_view(run.plan, view.xy, view.heading, camera)
    near, far = camera["range"]
    sector_area = (far**2 - near**2) * np.deg2rad(camera["angle_deg"]) / 2
    assert 0 < outline.area < 0.97 * sector_area
    inside = np.array(outline.representative_point().coords)
    assert VisibleRegion(run.plan, *view.xy.tolist()).contains(inside).all()
    assert near <= np.hypot(*(inside[0] - view.xy)) <= far


def test_camera_that_sees_all_round_is_drawn(tmp_path):
    run = base("robots.astro.camera={range: [0, 2], angle_deg: 360}", "simulation.duration=3 h")
    assert "what astro sees" in words_drawn(run, tmp_path)
