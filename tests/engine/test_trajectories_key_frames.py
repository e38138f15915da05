"""Key frames: every pose can be rebuilt from them."""

from tests.scenes import everything, path, run, scenario, table


def test_stored_poses_are_those_rebuilt_from_key_frames():
    stored = run(everything("1 h"), "artifacts.trajectories=every step")
    for name in ("ana", "ben", "astro", "bolt", "drift", "ego"):
        rows, poses = table(stored, "trajectories", entity=name), path(stored, name)
        here = ~rows["away"]
        assert rows["away"].tolist() == poses.away.tolist()
        assert rows["x"][here].tolist() == poses.x[here].tolist()
        assert rows["y"][here].tolist() == poses.y[here].tolist()
        assert rows["heading"].tolist() == poses.heading.tolist()


def test_key_frames_are_few_and_as_few_whatever_the_step():
    """A segment has its two ends, however many steps it takes."""
    users = {
        "ana": {"type": "schedule", "days": [{"items": [{"at": "07:05", "place": "kitchen"}]}]}
    }
    seconds, tenths = (
        run(scenario("20 min", users=users), f"simulation.step={step}") for step in ("1 s", "0.1 s")
    )
    count = len(table(seconds, "key_frames")["step"])
    assert 2 <= count < 60
    assert count == len(table(tenths, "key_frames")["step"])
