"""What is done to algorithms and sensors, beside the same run in which nothing is done."""

import numpy as np
import pytest
from tests.scenes import OWN, entries, scenario, table

import fleet2d
from fleet2d.errors import ScenarioError
from fleet2d.interventions import ReplaceOutput, ResetAlgorithm, Restore


def home(*script):
    return scenario(
        "1 h",
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol"}},
        objects={
            "door": {"type": "door", "doorway": "bathroom_1"},
            "motion": {"type": "motion_sensor", "at": [1.0, 3.0], "range": "6 m"},
        },
        algorithms={
            "smooth": {"type": f"{OWN}:Smooth", "reads": ["share"], "period": "10 min"},
            "share": {"type": f"{OWN}:Share", "period": "10 min"},
        },
        script=list(script),
    )


def shares(run, name):
    rows = table(run, name)
    return rows["share" if name == "share" else "mean"].reshape(6, -1)


def test_what_is_reset_begins_anew():
    run = fleet2d.Simulation(home())
    run.advance(1800)
    run.do(ResetAlgorithm("share"))
    run.advance(1)
    fresh = fleet2d.Simulation(home()).algorithms["share"]
    now = run.algorithms["share"].remember()
    assert str(fresh.remember()) == str(now)
    plain, stored = fleet2d.run(home()), run.run()
    assert (shares(plain, "share")[:3] == shares(stored, "share")[:3]).all()
    assert (shares(plain, "share")[3:] != shares(stored, "share")[3:]).any()


def test_a_replaced_output_is_read_by_others_and_its_own_table_stays():
    script = {"at": "15 min", "replace": "share", "rooms": {"kitchen_1": 1}, "duration": "20 min"}
    plain, run = fleet2d.run(home()), fleet2d.run(home(script))
    assert (shares(plain, "share") == shares(run, "share")).all()
    differs = (shares(plain, "smooth") != shares(run, "smooth")).any(axis=1)
    assert [False, True, True] == differs[:3].tolist()


def test_an_output_may_be_withheld_or_stay_as_it_is():
    run = fleet2d.Simulation(home())
    run.advance(700)
    run.do(ReplaceOutput("share", withheld=True, duration="5 min"))
    run.advance(1)
    assert "share" not in run.outputs
    run.advance(400)
    before = run.outputs["share"].share.copy()
    run.do(ReplaceOutput("share", frozen=True))
    run.advance(1500)
    np.testing.assert_array_equal(before, run.outputs["share"].share)
    run.do(Restore("share"))
    run.advance(1)
    assert (before != run.outputs["share"].share).any()


def readings(run):
    rows = table(run, "sensors")
    return list(zip(rows["step"].tolist(), rows["state"].tolist(), strict=True))


TIMES = "at: 20 min, duration: 10 min"


@pytest.mark.slow
@pytest.mark.parametrize("max_span", [None, 1])
def test_a_sensor_says_what_it_is_told_to_say(max_span):
    plain, silent, on, off = (
        readings(fleet2d.run(home(*entries(script)), max_span=max_span))
        for script in (
            "",
            f"{TIMES}, stick: motion",
            f"{TIMES}, stick: motion, says: on",
            f"{TIMES}, stick: motion, says: off",
        )
    )
    assert [row for row in plain if not 1200 <= row[0] < 1800] == silent
    for stuck in (on, off):
        assert [row for row in plain if row[0] < 1200] == [row for row in stuck if row[0] < 1200]
        assert 1 >= sum(1200 <= step < 1800 for step, _ in stuck)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("reset: shar", "did you mean 'share'"),
        ("replace: share", "one of 'rooms', 'values'"),
        ("replace: share, rooms: {kitchn_1: 1}", "did you mean 'kitchen_1'"),
        ("replace: share, rooms: {kitchen_1: -1}", "rooms.kitchen_1: weight -1 is negative"),
        ("stick: motio", "did you mean 'motion'"),
        ("restore: motio", "did you mean 'motion'"),
    ],
)
def test_what_can_not_be_is_refused(entry, words):
    with pytest.raises(ScenarioError, match=words):
        fleet2d.Simulation(home(*entries(f"at: 1 min, {entry}")))
