"""The picture of a run: drawn for every kind of run, deterministic, and true to what was stored."""

import json
import re
from datetime import datetime
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from tests.scenes import flat_path
from tests.thorough import some

import fleet2d
from fleet2d import Simulation, open_run
from fleet2d.errors import ArtifactError, InputError
from fleet2d.runs.run import FLOORPLAN_NAME
from fleet2d.runtime.local_time import zone_of

pytest.importorskip("matplotlib")

from matplotlib.image import imread
from matplotlib.patches import Polygon
from matplotlib.text import Text

from fleet2d.sight.fov import VisibleRegion
from fleet2d.viewing.pictures.life import best_view, field_of_view, opacity, trace_of
from fleet2d.viewing.pictures.run import (
    MARK_PART,
    MIN_MARK_HEIGHT,
    NOT_SIMULATED,
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
def two_days():
    """The paper's scenario for two days."""
    return base()


def base(*overrides, **settings):
    """Run the paper's scenario for two days."""
    return fleet2d.run("bundled:paper", "simulation.duration=2 d", *overrides, **settings)


def words_of(run):
    """Return the words of the picture of a run, without writing it to a file."""
    return "\n".join(text.get_text() for text in run_figure(run).findobj(Text))


def drawn(run, path):
    """Draw a run into a file; return the words in it, which matplotlib leaves in comments."""
    draw_run(run, path / "run.svg")
    return "\n".join(line for line in (path / "run.svg").read_text().splitlines() if "<!--" in line)


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
    words = drawn(run, tmp_path)
    facts = ("paper", "2 days in family_home", "seed 4", "ana", "astro", "away", "ways walked")
    for fact in (*facts, run.digest[:12]):
        assert fact in words
    assert "interrupted" not in words


@pytest.mark.slow
@pytest.mark.parametrize(("users", "robots"), [({}, {"eye": MEANDER}), (None, {}), ({}, {})])
def test_run_without_users_or_robots_is_drawn(tmp_path, users, robots):
    scenario = fleet2d.load_scenario("bundled:paper", "simulation.duration=3 h").resolved()
    scenario["users"] = scenario["users"] if users is None else users
    scenario["robots"] = scenario["robots"] if robots is None else robots
    words = drawn(fleet2d.run(scenario), tmp_path)
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
    assert "ana" in drawn(fleet2d.run("bundled:rounds", *overrides), tmp_path)


def test_of_many_users_four_are_shown_and_the_rest_counted():
    users = {f"person_{number:02d}": MEANDER for number in range(50)}
    simulation = {"duration": "30 min", "seed": 1}
    home = {"type": "bundled"}
    words = words_of(fleet2d.run({"simulation": simulation, "floorplan": home, "users": users}))
    assert "4 of 50 users are shown" in words
    assert "person_03" in words
    assert "person_04" not in words


@pytest.mark.slow
def test_interrupted_run_is_drawn_and_marked(tmp_path):
    simulation = Simulation("bundled:paper", "simulation.duration=2 d")
    simulation.advance(100_000)
    assert "interrupted" in drawn(simulation.finish(), tmp_path)


def test_run_that_simulated_nothing_is_drawn(tmp_path):
    words = drawn(Simulation("bundled:paper").finish(), tmp_path)
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
    assert "teal" == trace_of(run, run.plan, "ana", 0, robot=False).color
    assert trace_of(run, run.plan, "astro", 0, robot=True).color.startswith("#")


@pytest.mark.slow
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
    hours = SimpleNamespace(room=np.arange(50), every_us=3_600_000_000)
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
def test_too_many_rings_are_left_out_with_a_note():
    few = words_of(two_days())
    assert "seen here by a robot" in few
    assert "are not drawn" not in few
    scenario = fleet2d.load_scenario("bundled:paper", "simulation.duration=4 d").resolved()
    scenario["users"] = {"ana": MEANDER}
    many = words_of(fleet2d.run(scenario))
    assert "seen here by a robot" not in many
    assert "places where robots saw users are not drawn" in many


def saved_plan(path, width, height):
    """Store a rectangular home as HouseExpo does; return the part of a scenario that names it."""
    corners = [[0, 0], [width, 0], [width, height], [0, height], [0, 0]]
    path.write_text(json.dumps({"id": path.stem, "verts": corners}))
    return {"type": "houseexpo", "path": str(path)}


def half_an_hour(plan):
    """Run half an hour of somebody in a home."""
    ana = {**MEANDER, "radius": 0.2}
    simulation = {"duration": "30 min", "seed": 1}
    return fleet2d.run({"simulation": simulation, "floorplan": plan, "users": {"ana": ana}})


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1.9, 1.6), (30.0, 25.0), (25.0, 3.0), (3.0, 25.0)])
def test_words_of_the_scale_are_above_the_legend(tmp_path, monkeypatch, size):
    run = half_an_hour(saved_plan(tmp_path / f"{'2deaa98e' * 4}.json", *size))
    assert "30 minutes in 2deaa98e…" in words_of(run)  # a hash that names a plan is shortened
    figures = []
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
        draw_run(half_an_hour(saved_plan(tmp_path / f"{number}.json", *size)), tmp_path / "run.png")
        widths.append(imread(tmp_path / "run.png").shape[1])
    assert 1600 == widths[0]
    assert widths[1] < 1400


def test_ways_are_not_drawn_across_an_absence_nor_through_walls():
    run = two_days()
    ana = trace_of(run, run.plan, "ana", 0, robot=False)
    assert len(ana.legs) > 10
    along = np.linspace(0.02, 0.98, 25)[:, None]
    for start, end in ana.legs:
        points = start + along * (end - start)
        assert VisibleRegion(run.plan, *points[0].tolist()).contains(points[1:]).all()


def test_a_way_on_which_a_robot_brakes_is_drawn_as_one_line():
    def legs(drive):
        robot = {"type": "patrol", "waypoints": [[1, 3], [7, 1], [7, 6]], "dwell": "1 s"}
        content = {
            "simulation": {"duration": "3 min"},
            "floorplan": {"type": "native", "path": str(flat_path())},
            "robots": {"astro": {**robot, "start": [1, 3], "drive": drive}},
        }
        run = fleet2d.run(content)
        return trace_of(run, run.plan, "astro", 0, robot=True).legs

    usual, other = legs("differential"), legs("trapezoidal")
    assert other[:7] == pytest.approx(usual[:7], abs=0.002)  # a round


def test_field_of_view_is_what_is_visible_in_range_and_angle():
    run = two_days()
    camera = run.manifest["scenario"]["robots"]["astro"]["camera"]
    astro = trace_of(run, run.plan, "astro", 0, robot=True)
    view = best_view(run.plan, astro, camera, np.zeros(0, np.int64), np.zeros((0, 2)))
    outline = field_of_view(run.plan, view.xy, view.heading, camera)
    near, far = camera["range"]
    sector_area = (far**2 - near**2) * np.deg2rad(camera["angle_deg"]) / 2
    assert 0 < outline.area < 0.97 * sector_area
    inside = np.array(outline.representative_point().coords)
    assert VisibleRegion(run.plan, *view.xy.tolist()).contains(inside).all()
    assert near <= np.hypot(*(inside[0] - view.xy)) <= far


def test_camera_that_sees_all_round_is_drawn(tmp_path):
    run = base("robots.astro.camera={range: [0, 2], angle_deg: 360}", "simulation.duration=3 h")
    assert "what astro sees" in drawn(run, tmp_path)
