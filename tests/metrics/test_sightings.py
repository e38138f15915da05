"""Precision, recall and confusion, against the stored observations and a count of their own."""

import numpy as np
import pytest
from tests.scenes import run, scenario, table

CONFUSION = {"ana": {"ben": 1.0}, "ben": {"ana": 0.5, "cleo": 0.5}}


def content(period="10 min"):
    return scenario(
        "2 h",
        users={name: {"type": "meander"} for name in ("ana", "ben", "cleo")},
        robots={
            "astro": {
                "type": "patrol",
                "dwell": "20 s",
                "camera": {"detection": 0.7, "angle_deg": 180},
                "perception": {
                    "identity": {"right": 0.7, "mistaken": 0.2, "confusion": CONFUSION},
                    "false_positives": {"per_hour": 200, "looks_like": {"cleo": 0.5}},
                },
            },
            "blind": {"camera": None},
            "sharp": {"type": "meander", "camera": {"angle_deg": 360}},
        },
        metrics={"detections": {"period": period}},
    )


@pytest.fixture(scope="module")
def stored():
    return run(content())


def name_of(value, missing):
    return value if isinstance(value, str) else missing


def test_precision_and_confusion_equal_the_stored_rows(stored):
    rows = table(stored, "observations", robot="astro")
    true = np.array([name_of(v, "nobody") for v in rows["true_user"]])
    perceived = np.array([name_of(v, "unknown") for v in rows["user"]])
    result = stored.metrics["detections"]["astro"]
    assert (true != "nobody").mean() == pytest.approx(result["precision"])
    real = true != "nobody"
    assert (true == perceived)[real].mean() == pytest.approx(result["recognized"])
    for who, shares in result["confusion"].items():
        for identity in ("ana", "ben", "cleo", "unknown"):
            expected = (perceived[true == who] == identity).mean()
            assert expected == pytest.approx(shares[identity]), (who, identity)


def test_recall_and_confusion_are_those_configured(stored):
    """Looks of four hours a user in view, far more than these bounds need."""
    astro, sharp = (stored.metrics["detections"][name] for name in ("astro", "sharp"))
    looks = table(stored, "detections", robot="astro")
    assert looks["detected"].sum() / looks["in_view"].sum() == pytest.approx(astro["recall"])
    assert astro["recall"] == pytest.approx(0.7, abs=0.05)
    assert astro["confusion"]["ana"]["ben"] == pytest.approx(0.2, abs=0.05)
    # Zeros are there, too: means over the runs of a study are of all of them.
    assert 0 == astro["confusion"]["ana"]["cleo"]
    names = ("ana", "ben", "cleo", "unknown")
    exact = {true: {name: float(name == true) for name in names} for true in names[:3]}
    assert {
        "precision": 1,
        "recall": 1,
        "recognized": 1,
        "confusion": exact,
    }.items() <= sharp.items()


def test_a_robot_that_sees_nothing_has_no_shares(stored):
    assert {} == stored.metrics["detections"]["blind"]


def test_rows_of_all_periods_add_up_to_the_observations(stored):
    rows = table(stored, "detections")
    observed = table(stored, "observations")
    assert len(observed["step"]) == rows["observed"].sum()
    for user in ("ana", "ben", "cleo"):
        mine = rows["user"] == user
        assert (observed["true_user"] == user).sum() == rows["observed"][mine].sum()
        assert rows["detected"][mine].sum() == rows["observed"][mine].sum()  # without latency
    assert (rows["in_view"] >= rows["detected"]).all()


def test_results_do_not_depend_on_the_period(stored):
    assert stored.metrics["detections"] == run(content("7 min")).metrics["detections"]


def test_without_users_nothing_is_stored():
    scene = content()
    scene["users"] = {}
    scene["robots"] = {"sharp": scene["robots"]["sharp"]}
    stored = run(scene)
    assert {"sharp": {}} == stored.metrics["detections"]
    assert "detections" not in stored.tables
