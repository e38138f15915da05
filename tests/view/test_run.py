"""The picture of a run: drawn for every kind of run, deterministic, and true to what was stored."""

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fleet2d
from fleet2d import Run, Simulation, open_run
from fleet2d.artifacts.reader import FLOORPLAN_NAME
from fleet2d.errors import ArtifactError, InputError

pytest.importorskip("matplotlib")

from fleet2d.sight.region import VisibleRegion
from fleet2d.view.actogram import (
    NOT_SIMULATED,
    hours_shown,
    marks_by_day,
    room_color,
    rooms_by_day,
)
from fleet2d.view.life import field_of_view, telling_view
from fleet2d.view.run import draw_run
from fleet2d.view.traces import Trace, trace_of

MEANDER = {"type": "meander"}
START = datetime(2026, 1, 5)


def base(*overrides: str, **settings: Any) -> Run:
    """Run the bundled base scenario for two days."""
    return fleet2d.run(None, "simulation.duration=2 d", *overrides, **settings)


def words_in(svg: Path) -> str:
    """Return the words of a picture: matplotlib leaves them in comments."""
    return "\n".join(line for line in svg.read_text().splitlines() if "<!--" in line)


def drawn(run: Run, tmp_path: Path) -> str:
    """Draw a run; return the words in the picture."""
    draw_run(run, tmp_path / "run.svg")
    return words_in(tmp_path / "run.svg")


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_same_run_gives_same_bytes(tmp_path: Path, ending: str) -> None:
    run = base(out=tmp_path / "run")
    first, second = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
    draw_run(run, first)
    draw_run(open_run(tmp_path / "run"), second)
    assert first.read_bytes() == second.read_bytes()
    assert [] == list(tmp_path.glob("*.unfinished"))


def test_picture_says_what_was_run(tmp_path: Path) -> None:
    run = base()
    assert run.digest is not None
    words = drawn(run, tmp_path)
    for told in (
        "base",
        "2 days in family_home",
        "seed 4",
        run.digest[:12],
        "ana",
        "astro",
        "away",
    ):
        assert told in words
    assert "interrupted" not in words


@pytest.mark.parametrize(
    ("users", "robots"), [({}, None), (None, {}), ({}, {}), ({"bo": MEANDER}, {"eye": MEANDER})]
)
def test_run_without_users_or_robots_is_drawn(
    tmp_path: Path, users: dict[str, Any] | None, robots: dict[str, Any] | None
) -> None:
    scenario = fleet2d.load_scenario(None, "simulation.duration=3 h").resolved()
    scenario["users"] = scenario["users"] if users is None else users
    scenario["robots"] = scenario["robots"] if robots is None else robots
    words = drawn(fleet2d.run(scenario), tmp_path)
    for name in (*scenario["users"], *scenario["robots"]):
        assert name in words


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("artifacts.key_frames=false", "no key frames were stored: positions every 1 h"),
        ("artifacts={key_frames: false, trajectories: off}", "where users were is not stored"),
        ("artifacts={observations: false, events: false, outputs: false}", "ana"),
    ],
)
def test_run_that_stored_less_says_so(tmp_path: Path, override: str, told: str) -> None:
    assert told in drawn(base(override), tmp_path)


@pytest.mark.parametrize(
    "overrides",
    [
        ("simulation.duration=1 s",),
        ("simulation.duration=5 s", "simulation.start=2026-01-05T23:59:58"),
        ("simulation.duration=2 h", "simulation.start=2026-01-05T10:40"),
        ("simulation.step=2 h", "artifacts.trajectories=off", "simulation.duration=3 d"),
        ("simulation.duration=120 d", "robots={}", "metrics={}"),
    ],
)
def test_short_and_long_runs_are_drawn(tmp_path: Path, overrides: tuple[str, ...]) -> None:
    assert "ana" in drawn(fleet2d.run(None, *overrides), tmp_path)


def test_of_many_users_four_are_shown_and_the_rest_counted(tmp_path: Path) -> None:
    users = {f"person_{number:02d}": MEANDER for number in range(50)}
    run = fleet2d.run(
        {
            "simulation": {"duration": "30 min", "seed": 1},
            "floorplan": {"type": "bundled"},
            "users": users,
        }
    )
    words = drawn(run, tmp_path)
    assert "4 of 50 users are shown" in words
    assert "person_03" in words
    assert "person_04" not in words


def test_interrupted_run_is_drawn_and_marked(tmp_path: Path) -> None:
    simulation = Simulation(None, "simulation.duration=2 d")
    simulation.advance(100_000)
    assert "interrupted" in drawn(simulation.finish(), tmp_path)


def test_run_that_simulated_nothing_is_drawn(tmp_path: Path) -> None:
    words = drawn(Simulation(None).finish(), tmp_path)
    assert "0 s in family_home" in words


def test_run_that_lost_its_floor_plan_says_so(tmp_path: Path) -> None:
    base(out=tmp_path / "run")
    (tmp_path / "run" / FLOORPLAN_NAME).unlink()
    with pytest.raises(ArtifactError, match=f"{FLOORPLAN_NAME} is missing"):
        draw_run(open_run(tmp_path / "run"), tmp_path / "a.png")


def test_picture_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"written as \.png or"):
        draw_run(base(), tmp_path / "run.jpg")


def test_colour_that_is_given_is_used(tmp_path: Path) -> None:
    run = base("users.ana.color=teal", "robots.astro.color=no colour")
    ana = trace_of(run, run.plan, "ana", 0, robot=False)
    astro = trace_of(run, run.plan, "astro", 0, robot=True)
    assert ana is not None
    assert astro is not None
    assert "teal" == ana.color
    assert astro.color.startswith("#")


def test_actogram_has_the_rooms_of_every_minute() -> None:
    run = base("simulation.start=2026-01-09T10:30", "artifacts.trajectories=4 s")
    ana = trace_of(run, run.plan, "ana", 0, robot=False)
    assert ana is not None
    start = datetime.fromisoformat(run.manifest["start"])
    rooms = rooms_by_day(ana, start, 1_000_000, run.manifest["steps"])
    stored = run.pandas("trajectories")
    truth = stored[stored["entity"] == "ana"]["room"].cat.codes.to_numpy()
    # A minute has the colour of its middle; the run is sampled every 4 s.
    middles = np.arange(30, 2 * 86_400, 60) // 4
    assert truth[middles].tolist() == rooms.ravel()[10 * 60 + 30 :][: len(middles)].tolist()
    assert (3, 1440) == rooms.shape
    assert {NOT_SIMULATED} == set(rooms[0, : 10 * 60 + 30].tolist())
    assert {NOT_SIMULATED} == set(rooms[2, 10 * 60 + 30 :].tolist())
    assert (0.0, 24.0) == hours_shown(rooms)


def test_marks_are_where_the_user_was_seen() -> None:
    seen = np.array([0, 299, 300, 86_399, 86_400])
    marks = marks_by_day(seen, START, 1_000_000, 2)
    assert [(0, 0), (0, 1), (0, 287), (1, 0)] == [tuple(at) for at in np.argwhere(marks).tolist()]


def test_rooms_in_the_actogram_are_a_deeper_shade_of_the_plan() -> None:
    plan = fleet2d.load_floorplan()
    colors = {room.type: room_color(plan, room.index) for room in plan.rooms}
    assert all(0 <= part <= 1 for color in colors.values() for part in color)
    assert colors["kitchen"] != colors["living_room"] != colors["dining_room"]


def test_ways_are_not_drawn_across_an_absence_nor_through_walls() -> None:
    run = base()
    ana = trace_of(run, run.plan, "ana", 0, robot=False)
    assert ana is not None
    assert len(ana.legs) > 10
    along = np.linspace(0.02, 0.98, 25)[:, None]
    for start, end in ana.legs:
        points = start + along * (end - start)
        assert VisibleRegion(run.plan, *points[0].tolist()).contains(points[1:]).all()


def test_field_of_view_is_what_is_visible_in_range_and_angle() -> None:
    run = base()
    camera = run.manifest["scenario"]["robots"]["astro"]["camera"]
    astro = trace_of(run, run.plan, "astro", 0, robot=True)
    assert isinstance(astro, Trace)
    view = telling_view(run.plan, astro, camera, {})
    assert view is not None
    outline = field_of_view(run.plan, view.xy, view.heading, camera)
    near, far = camera["range"]
    whole = (far**2 - near**2) * np.deg2rad(camera["angle_deg"]) / 2
    assert 0 < outline.area < 0.97 * whole
    inside = np.array(outline.representative_point().coords)
    assert VisibleRegion(run.plan, *view.xy.tolist()).contains(inside).all()
    assert near <= np.hypot(*(inside[0] - view.xy)) <= far


def test_camera_that_sees_all_round_is_drawn(tmp_path: Path) -> None:
    run = base("robots.astro.camera={range: [0, 2], angle_deg: 360}", "simulation.duration=3 h")
    assert "what astro sees" in drawn(run, tmp_path)
