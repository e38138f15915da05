"""Errors of perception that are components: what they do to the rows and events of a run."""

import copy
from pathlib import Path

import numpy as np
import pytest
from tests.engine.test_cameras import looks
from tests.scenes import OWN, digests, run, table

import fleet2d
from fleet2d.engine.sighting_errors import SightingErrors

ERRORS = OWN.replace("own_components", "own_errors")


def unsure(**errors):
    """Four robots with cameras of all kinds, whose perceptions all have these errors."""
    content = looks()
    content["simulation"]["duration"] = "20 min"
    for robot in ("astro", "bolt", "curio", "drift"):
        perception = content["robots"][robot].setdefault("perception", {})
        perception["errors"] = {
            name: {"type": f"{ERRORS}:{error.pop('type')}", **error}
            for name, error in copy.deepcopy(errors).items()
        }
    return content


def astro_with(errors):
    """Return the section of robots with one, which has these errors."""
    robots = unsure()["robots"]
    return {"robots": {"astro": {**robots["astro"], "perception": {"errors": errors}}}}


def reactions(stored):
    """Return the events of seeing and losing, and what robots do about them."""
    rows = stored.tables["events"].to_pylist()
    return [row for row in rows if row["event"] in ("user_seen", "user_lost", "reacts")]


@pytest.mark.slow
def test_a_run_is_the_same_for_every_max_span():
    content = unsure(blinking={"type": "Blinking"})
    content["simulation"]["duration"] = "5 min"
    content["robots"]["astro"]["localization"] = {"drift": "3 cm", "drift_deg": 1}
    first, *others = (digests(run(content, max_span=span)) for span in (None, 600, 7, 1))
    assert [first] * 3 == others


def test_a_person_who_is_missed_is_as_one_who_is_suppressed():
    """The look itself knows suppressed people: rows, events, reactions and counts must be equal."""
    by_script = unsure()
    by_script["script"] = [
        {"at": "5 min", "suppress": robot, "user": "ben", "duration": "10 min"}
        for robot in ("astro", "bolt", "curio", "drift")
    ]
    missed = {"type": "Missed", "person": "ben", "first": 300, "end": 900}
    scripted = run({**by_script, "metrics": {"detections": {"period": "10 min"}}})
    erring = run({**unsure(missed=missed), "metrics": {"detections": {"period": "10 min"}}})
    for name in ("observations", "detections"):
        assert scripted.tables[name].equals(erring.tables[name]), name
    assert scripted.metrics == erring.metrics
    assert reactions(scripted) == reactions(erring)
    assert len(reactions(erring)) > 50


@pytest.mark.parametrize("other", ["ana", "unknown"])
def test_a_person_who_is_mistaken_is_as_one_whom_a_script_lets_be(other):
    by_script = unsure()
    by_script["script"] = [
        {"at": "5 min", "mistake": robot, "user": "ben", "taken_for": other, "duration": "10 min"}
        for robot in ("astro", "bolt", "curio", "drift")
    ]
    mistaken = {
        "type": "Mistaken",
        "person": "ben",
        "taken_for": other,
        "first": 300,
        "end": 900,
    }
    scripted, erring = run(by_script), run(unsure(mistaken=mistaken))
    assert scripted.tables["observations"].equals(erring.tables["observations"])
    assert reactions(scripted) == reactions(erring)


def test_events_are_those_of_the_look(monkeypatch):
    """Noted anew from sightings that are as they were, events are the same."""
    content = unsure(nothing={"type": "Missed", "person": "ana", "end": 0})
    expected = digests(run(content))
    change, calls = SightingErrors.change, []

    def as_if_changed(self, rows, memory, before, *rest):
        rows, _ = change(self, rows, memory, before, *rest)
        memory.noticed[:], memory.seen[:] = before.noticed, before.seen
        calls.append(len(rows))
        return rows, True

    monkeypatch.setattr(SightingErrors, "change", as_if_changed)
    assert expected == digests(run(content))
    assert len(calls) > 50
    assert expected == digests(run(unsure()))


def test_each_camera_may_have_its_own_errors_and_each_error_its_own_draws():
    content = unsure()
    cameras = content["robots"]["astro"]["cameras"]
    moved = {
        "errors": {"a": {"type": "outliers", "share": 1}, "b": {"type": "outliers", "share": 0}}
    }
    cameras["rear"]["perception"] = moved
    rows = table(run(content), "observations", robot="astro")
    is_off = (rows["x"] != rows["true_x"]) & ~np.isnan(rows["true_x"].astype(float))
    assert is_off[rows["camera"] == "rear"].mean() > 0.95
    assert not is_off[rows["camera"] != "rear"].any()
    del moved["errors"]["b"]  # which was drawn, and never used
    alone = table(run(content), "observations", robot="astro")
    np.testing.assert_array_equal(rows["x"], alone["x"])


def test_errors_act_in_the_order_of_their_names():
    """A stored scenario has its keys in the order of the alphabet: the file's order can't count."""
    moved = {"type": "miscalibration", "offset": "1 m"}
    scaled = {"type": "miscalibration", "scale": 2.0}
    named = {"a": scaled, "b": moved}
    first, twin, other = (
        table(run({**unsure(), **astro_with(errors)}), "observations", robot="astro")
        for errors in (named, dict(reversed(named.items())), {"a": moved, "b": scaled})
    )
    np.testing.assert_array_equal(first["x"], twin["x"])
    assert (first["x"] != other["x"]).mean() > 0.9


@pytest.mark.parametrize(
    ("returns", "message"),
    [
        ("nothing", "distort returned None: return what sightings.replace"),
        ("rows", "distort returned {'x': array"),
        ("nan", "x is nan for the look at step"),
        ("far", "y is 1e+09 for the look at step"),
        ("short", "heading has the shape"),
        ("words", "heading holds <U5: expected numbers"),
        ("posture", "posture is 3 for the look at step"),
        ("nobody", "user is 7 for the look at step"),
        ("share", "noticed holds float64: expected true and false"),
        ("state", "errors of perception keep no state"),
        ("write", "assignment destination is read-only"),
        ("anything else", "KeyError: 'kitchen'"),
    ],
)
def test_a_wrong_error_is_named_with_its_step(returns, message):
    content = unsure(odd={"type": "Wrong", "returns": returns})
    with pytest.raises(fleet2d.ComponentError) as caught:
        run(content)
    text = str(caught.value)
    assert "robots.astro.perception.errors.odd failed at step" in text
    assert message in text
    assert "own_errors.py" in text or returns in ("nothing", "rows")


@pytest.mark.slow
def test_a_copied_a_saved_and_a_repeated_run_are_the_same(tmp_path):
    content = unsure(blinking={"type": "Blinking"})
    whole = run(content, out=tmp_path / "run")
    assert fleet2d.reproduce(tmp_path / "run", trust=True).same
    assert "own_errors.py" in {Path(file["path"]).name for file in whole.manifest["inputs"]}
    simulation = fleet2d.Simulation(content)
    simulation.run_until("07:08")
    twin = copy.deepcopy(simulation)
    simulation.save(tmp_path / "state")
    loaded = fleet2d.Simulation.load(tmp_path / "state")
    assert {whole.digest} == {each.run().digest for each in (simulation, twin, loaded)}


@pytest.mark.parametrize("robot", ["astro", "curio"])
def test_a_fault_brings_errors_to_the_looks_within_it(robot):
    """What a camera with latency saw before becomes known within the fault, as it was seen."""
    content = unsure()
    content["robots"]["astro"]["perception"] = None
    errs = {"errors": {"miscalibration": {"offset": "50 cm"}}}
    fault = {"at": "5 min", "fault": robot, "errs": errs, "duration": "10 min"}
    rows = table(run({**content, "script": [fault]}), "observations", robot=robot)
    is_off = rows["x"] != rows["true_x"]
    look = rows["step"] - np.where(rows["camera"] == "front", 2, 0)
    is_within = (look >= 300) & (look < 900)
    assert is_off[is_within].mean() > 0.9
    assert is_within.sum() > 10 < (~is_within).sum()
    assert not is_off[~is_within].any()
