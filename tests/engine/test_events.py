"""Algorithms and metrics that events update: at which steps, with which history, in any spans."""

import numpy as np
import pytest
from tests.scenes import digests, everything, run, table
from tests.thorough import some

from fleet2d import Algorithm, Metric

SENSORS = {
    "hall": {"type": "motion_sensor", "at": [2.5, 2.5], "range": 4},
    "bed": {"type": "motion_sensor", "at": [2.5, 5.5], "range": 3, "hold": "20 s"},
}


class Heard(Algorithm):
    """Notes what it was handed, and what happened at its last step."""

    def update(self, history, state):
        now = sorted({event.event for event in history.events if event.step == state.step})
        return {
            "first": history.first,
            "end": history.end,
            "now": " ".join(now),
            "said": int((history.readings.step == state.step).sum()),
            "seen": len(history.observations.step),
        }


class HeardMetric(Metric):
    """The same, as a metric."""

    def start(self, home):
        self.steps = []

    def update(self, history, state):
        self.steps.append(state.step)

    def result(self):
        return {"steps": self.steps}


def content(duration="30 min", **sections):
    found = everything(duration)
    for section, entries in sections.items():
        found[section] = {**found.get(section, {}), **entries}
    return found


def heard(*names):
    return {"type": f"{__name__}:Heard", "on": list(names)}


ALL = {
    "sights": heard("user_seen", "user_lost"),
    "notes": heard("reacts"),
    "sensors": heard("sensor"),
    "lives": heard("activity"),
    "some": heard("user_lost", "sensor", "obeys"),
}
METRICS = {"diary": {"type": f"{__name__}:HeardMetric", "on": ["activity", "obeys"]}}


def whole_run(**simulation):
    return run(content(algorithms=ALL, metrics=METRICS, objects=SENSORS), **simulation)


@pytest.fixture(scope="module")
def whole():
    return whole_run()


def steps_of(stored, events, who):
    rows = table(stored, "events")
    mine = np.isin(rows["event"], list(events)) & np.isin(rows["entity"], list(who))
    return np.unique(rows["step"][mine]).tolist()


ROBOTS = ("astro", "bolt", "curio", "drift", "ego")


@pytest.mark.parametrize(
    ("name", "events"),
    [("sights", {"user_seen", "user_lost"}), ("notes", {"reacts"}), ("lives", set())],
)
def test_an_algorithm_is_updated_at_the_steps_of_its_events(whole, name, events):
    expected = steps_of(whole, events, ROBOTS)
    if not events:  # of users, whom algorithms don't hear
        assert name not in whole.tables
        assert f"algorithms.{name} was never updated: no activity happened" in whole.notes
        return
    rows = table(whole, name)
    assert len(expected) > 5
    assert expected == rows["step"].tolist()
    assert all(set(now.split()) & events for now in rows["now"])


def test_readings_of_sensors_are_events(whole):
    expected = np.unique(table(whole, "sensors")["step"]).tolist()
    rows = table(whole, "algorithms_sensors")
    assert len(expected) > 3
    assert expected == rows["step"].tolist()
    assert (rows["said"] > 0).all()


def test_histories_join_without_gaps_from_update_to_update(whole):
    rows = table(whole, "some")
    assert [0, *rows["end"][:-1]] == rows["first"].tolist()
    assert (rows["step"] + 1).tolist() == rows["end"].tolist()
    seen = table(whole, "observations")["step"]
    assert (seen < rows["end"][-1]).sum() == rows["seen"].sum()


def test_metrics_hear_of_users_and_get_the_rest_at_the_end(whole):
    expected = steps_of(whole, {"activity"}, ("ana", "ben"))
    expected = sorted({*expected, *steps_of(whole, {"obeys"}, ROBOTS)})
    assert [*expected, 1799] == whole.metrics["diary"]["steps"]


@pytest.mark.slow
@pytest.mark.parametrize("span", some([1, 7, 600], 2))
def test_events_are_the_same_for_every_max_span(whole, span):
    other = whole_run(max_span=span)
    assert digests(whole) == digests(other)
    assert whole.metrics == other.metrics


def test_who_waits_for_events_changes_nothing_else(whole):
    without = digests(run(content(objects=SENSORS)))
    with_them = digests(whole)
    for name, digest in without.items():
        if name != "run":
            assert digest == with_them[name], name


def test_a_period_beside_events_is_not_minded():
    odd = {"heard": {**heard("user_seen"), "period": "1.5 s"}}
    assert len(table(run(content("20 min", algorithms=odd)), "heard")["step"])
