"""Key frames: every pose can be rebuilt from them."""

from tests.scenes import run, scenario, table


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
