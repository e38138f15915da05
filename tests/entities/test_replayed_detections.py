"""What a real robot perceived, replayed: rows, events, algorithms, metrics, and what is refused."""

import copy
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

import fleet2d
from fleet2d.errors import InputError

HEAD = "time,label,x,y\n"


def place(room):
    """Return a place in the middle of a room of the bundled home."""
    plan = fleet2d.load_floorplan()
    return next(r.anchor_xy for r in plan.rooms if r.name == room)


def scenario(path, **robot):
    return {
        "extends": "bundled:paper",
        "simulation": {"duration": "1 h", "seed": 4},
        "users": {"ana": {"type": "unknown"}},
        "robots": {"astro": {"perceives": {"type": "replay", "path": str(path)} | robot}},
        "algorithms": {
            "ltp": {"type": "long_term_presence", "period": "10 min"},
            "rtp": {"type": "real_time_presence"},
        },
        "metrics": {
            "detections": {},
            "sightings": {},
            "rtp_score": {"of": "rtp"},
            "ltp_error": None,
        },
    }


def detections(path, rows):
    path.write_text(HEAD + "".join(f"{t},{who},{x},{y}\n" for t, who, x, y in rows))
    return path


@pytest.fixture
def kitchen(tmp_path):
    x, y = place("kitchen_1")
    rows = [(float(t), "ana", x, y) for t in range(600, 660)]
    return detections(tmp_path / "seen.csv", [*rows, (700.4, "person", x + 0.1, y)])


def test_detections_are_the_observations_of_the_run(kitchen, tmp_path):
    run = fleet2d.run(scenario(kitchen), out=tmp_path / "run")

    table = run.tables["observations"]
    x, _ = place("kitchen_1")
    assert table["step"].to_pylist() == [*range(600, 660), 700]
    assert table["user"].to_pylist() == ["ana"] * 60 + [None]
    assert set(table["room"].to_pylist()) == {"kitchen_1"}
    assert np.allclose(table["x"].to_numpy(), [x] * 60 + [x + 0.1], atol=1e-3)
    assert set(table["truth_known"].to_pylist()) == {False}
    assert set(table["true_user"].to_pylist()) == {None}
    assert [Path(i["path"]).name for i in run.manifest["inputs"]] == ["seen.csv"]
    assert run.metrics["detections"] == {"astro": {"unknown_truth": 61}}
    assert run.metrics["rtp_score"] == {"ana": {"truth unknown": {"bins": 60}}}
    assert run.metrics["sightings"] == {}


def test_events_say_when_somebody_is_seen_and_lost(kitchen):
    run = fleet2d.run(scenario(kitchen))

    events = run.tables["events"].to_pylist()
    seen = [(e["step"], e["event"], e["user"]) for e in events if e["event"].startswith("user_")]
    assert seen == [
        (600, "user_seen", "ana"),
        (664, "user_lost", "ana"),
        (700, "user_seen", None),
        (705, "user_lost", None),
    ]


def test_known_truth_and_real_sightings_score_the_belief(tmp_path, kitchen):
    x, y = place("kitchen_1")
    truth = tmp_path / "uwb.csv"
    truth.write_text("time,x,y\n" + "".join(f"{t},{x},{y}\n" for t in range(600, 2400, 30)))
    content = scenario(kitchen)
    content["users"] = {"ana": {"type": "replay", "path": str(truth)}}

    metrics = fleet2d.run(content).metrics

    bins = {gap: scores["bins"] for gap, scores in metrics["rtp_score"]["ana"].items()}
    assert (bins["all"], bins["truth unknown"]) == (29, 31)
    assert "never seen" not in bins
    assert metrics["sightings"]["ana"] == pytest.approx(60 / 1771, rel=0.01)


def test_every_span_length_and_a_copy_give_the_same_run(kitchen):
    content = scenario(kitchen)
    content["robots"]["astro"]["behaviors"] = [{"type": "opportunistic"}, {"type": "patrol"}]
    simulation = fleet2d.Simulation(content)
    simulation.advance(630)

    digests = {fleet2d.run(content, max_span=span).digest for span in (1, 7, None)}

    assert digests == {copy.deepcopy(simulation).run().digest}


def test_positions_in_the_frame_of_the_robot_turn_with_it(tmp_path):
    path = detections(tmp_path / "seen.csv", [(t, "ana", 1.0, 0.5) for t in range(0, 600, 10)])
    content = scenario(path, relative_to="robot")
    content["robots"]["astro"]["behaviors"] = [{"type": "patrol"}]

    run = fleet2d.run(content)

    poses, table = run.path("astro", every=timedelta(seconds=10)), run.tables["observations"]
    robot = poses.x[:60] + 1j * poses.y[:60]
    seen = robot + (1 + 0.5j) * np.exp(1j * poses.heading[:60])
    assert np.allclose(table["x"].to_numpy() + 1j * table["y"].to_numpy(), seen, atol=3e-3)


def test_few_detections_outside_are_left_out_and_counted(tmp_path):
    x, y = place("kitchen_1")
    rows = [(t, "ana", x - 2, y + 1) for t in range(9)] + [(9, "ana", -44.0, y)]
    path = detections(tmp_path / "seen.csv", rows)

    run = fleet2d.run(scenario(path, frame={"origin": [2, -1]}))

    assert run.tables["observations"]["room"].to_pylist() == ["kitchen_1"] * 9
    notes = " ".join(run.manifest["notes"])
    assert "1 of 10 detections are outside the home and left out, by up to 4" in notes


@pytest.mark.slow
def test_a_frame_off_by_a_metre_is_told_where_it_leads_through_walls(tmp_path):
    """Within the reach of a metre nothing is left out, but what is in walls is counted."""
    x, y = place("kitchen_1")
    plan = fleet2d.load_floorplan()
    rows = [(t, "ana", x + t / 10 - 4, y) for t in range(80)]  # through the walls beside
    inside = [row for row in rows if plan.room_at(*row[2:]) is not None]
    path = detections(tmp_path / "seen.csv", inside)

    notes = " ".join(fleet2d.Simulation(scenario(path, frame={"origin": [0.6, 0.6]})).notes)

    assert "detections are in or behind walls, by up to 0." in notes


def test_what_is_from_before_the_run_is_left_out_and_counted(kitchen):
    content = scenario(kitchen)
    content["simulation"]["start"] = "2026-01-05T00:10:30"

    run = fleet2d.run(content)

    note = "robots.astro: of 61 detections, 30 are before the run and 0 after its end"
    assert note in run.manifest["notes"]
    assert run.tables["observations"].num_rows == 31


@pytest.mark.parametrize(
    ("rows", "options", "message"),
    [
        ([(0, "ana", 80.0, 80.0)], {}, "the frame of"),
        ([(0, "anna", 1.0, 1.0)], {}, r"named 'anna' \(1 detections\): say who .*people: {anna: NAME}"),
        ([(0, "ana", 1.0, 1.0)], {"people": {"f7": "ana"}}, "people: the log has no label 'f7'"),
        ([(0, "f7", 1.0, 1.0)], {"people": {"f7": "anna"}}, "people: there is no user 'anna'"),
        ([(90000, "ana", 1.0, 1.0)], {}, "the log is from 2026-01-06 01:00:00 to .*, the run from 2026-01-05"),
        ([(0, "ana", 1.0, 1.0)], {"day": 3}, "day 3 of the log, which has the days 0 to 0"),
        ([(0, "ana", 9.0, 4.0)], {"frame": {"rotation_deg": 90}}, r"1 of 1 detections are more than 1 m outside, by \d+\.\d m"),
    ],
)  # fmt: skip
def test_a_log_that_does_not_fit_is_refused(tmp_path, rows, options, message):
    with pytest.raises(InputError, match=f"robots.astro.perceives: .*{message}"):
        fleet2d.Simulation(scenario(detections(tmp_path / "seen.csv", rows), **options))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"camera": None}, "it needs a camera"),
        ({"perception": {"false_positives": {"per_hour": 1}}}, "give 'perceives' or 'perception'"),
    ],
)
def test_a_robot_perceives_in_one_way(kitchen, change, message):
    content = scenario(kitchen)
    content["robots"]["astro"] |= change

    with pytest.raises(InputError, match=message):
        fleet2d.Simulation(content)


def test_there_must_be_users(kitchen):
    content = scenario(kitchen) | {
        "users": {"ana": None},
        "algorithms": {"ltp": None},
        "metrics": {},
    }

    with pytest.raises(InputError, match="there are no users to be perceived"):
        fleet2d.Simulation(content)


def test_its_camera_cannot_be_disturbed(kitchen):
    simulation = fleet2d.Simulation(scenario(kitchen))

    with pytest.raises(InputError, match="its cameras can't be changed"):
        simulation.do({"switch_off": "astro", "camera": True})


def both_ways(folder):
    """Return a scenario whose robot perceives somebody by a table, and the same by a script."""
    x, y = place("kitchen_1")
    steps = [600, 601, 602, 1500, 1501, 2400]
    table = detections(folder / "ghosts.csv", [(float(s), "ana", x, y) for s in steps])
    base = {"extends": "bundled:paper", "simulation": {"duration": "1 h", "seed": 4}}
    source = {"type": "replay", "path": str(table), "besides_cameras": True}
    ghost = {"do": "inject", "entity": "astro", "user": "ana", "spot": [x, y], "duration": "1 s"}
    return (
        base | {"robots": {"astro": {"perceives": source}}},
        base | {"script": [{"at": f"{s} s", **ghost} for s in steps]},
    )


def test_detections_besides_the_cameras_are_injected_ones(tmp_path):
    """A table of them is as good as a script, and a hundred times as fast."""
    table, script = (fleet2d.run(content) for content in both_ways(tmp_path))

    assert table.tables["observations"].num_rows > 6
    for name in ("observations", "events", "key_frames"):
        assert table.tables[name].to_pylist() == script.tables[name].to_pylist()


def test_detections_besides_the_cameras_are_the_same_for_every_span(tmp_path):
    content, _ = both_ways(tmp_path)
    content["robots"]["astro"]["perception"] = {"detection": {"posture": {"sit": 0.5}}}

    assert len({fleet2d.run(content, max_span=span).digest for span in (7, 600, None)}) == 1
