"""Interrupts when the last person leaves the home, and when the first one comes back."""

import pytest
from tests.scenes import run, scenario, table

OUT = [
    {"at": "07:02", "away": True},
    {"at": "07:06", "place": "kitchen"},
]


@pytest.mark.parametrize(("event", "kind"), [("home_empty", "left_home"), ("home_occupied", "came_home")])  # fmt: skip
def test_robot_decides_once_after_the_last_person_left_or_the_first_came(
    event: str, kind: str
) -> None:
    waits = {
        "type": "tests.engine.interrupts.test_interrupt:Waits",
        "event": event,
    }
    people = {n: {"type": "schedule", "days": [{"items": OUT}]} for n in ("ana", "ben")}
    stored = run(scenario("10 min", users=people, robots={"astro": {"behaviors": [waits]}}))

    steps = table(stored, "events", event=kind)["step"].tolist()
    (reaction,) = table(stored, "events", event="reacts")["step"].tolist()
    assert 2 == len(steps)
    expected = max(steps) if event == "home_empty" else min(steps)
    assert expected <= reaction <= expected + 2
