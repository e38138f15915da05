"""What is written down, how often, and in which order."""

import pytest
from tests.scenes import digests, everything, run, scenario, table

from fleet2d.engine import recorder

DECISIONS = {"trajectories": "1 min", "decisions": True}


def small(**artifacts):
    return scenario(
        "30 min",
        users={"ana": {"type": "meander"}, "ben": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "30 s"}},
        artifacts=artifacts,
        metrics={"room_share": {"period": "10 min"}},
    )


@pytest.mark.slow
def test_every_step_of_the_end_is_the_same_when_rows_are_handed_over_late_or_early(monkeypatch):
    """The last rows of several bodies fall on one step: where they break off."""
    for seconds in (601, 613, 640):
        content = everything(f"{seconds} s")
        expected = digests(run(content))
        with monkeypatch.context() as patch:
            patch.setattr(recorder, "MAX_ROWS", 0)
            assert expected == digests(run(content, max_span=1)), seconds


@pytest.mark.parametrize("name", ["trajectories", "key_frames", "observations", "decisions"])
def test_rows_are_in_order_of_step_and_entity(name):
    stored = run(everything("1 h", artifacts=DECISIONS))
    columns = table(stored, name)
    bodies = [*stored.manifest["entities"]["users"], *stored.manifest["entities"]["robots"]]
    who = columns["robot" if name == "observations" else "entity"]
    keys = list(zip(columns["step"].tolist(), [bodies.index(w) for w in who], strict=True))
    if name == "observations":
        users = [bodies.index(u) for u in columns["user"]]
        keys = [(*key, user) for key, user in zip(keys, users, strict=True)]
        assert len(keys) == len(set(keys))
    assert len(keys) > 20
    assert keys == sorted(keys)


@pytest.mark.parametrize("name", ["trajectories", "key_frames", "observations", "events"])
def test_a_table_that_is_off_is_not_there_and_changes_no_other(name):
    everything_on = digests(run(small()))
    off = digests(run(small(**{name: "off" if name == "trajectories" else False})))
    assert everything_on.keys() - {name} == off.keys()
    assert {k: v for k, v in everything_on.items() if k not in ("run", name)} == {
        k: v for k, v in off.items() if k != "run"
    }


def test_decisions_change_no_other_table_and_name_the_behavior_that_decided():
    without, stored = run(small()), run(small(decisions=True))
    assert without.digest != stored.digest
    assert without.manifest["tables"].items() <= stored.manifest["tables"].items()
    decisions = table(stored, "decisions", entity="astro")
    assert {"patrol"} == set(decisions["behavior"])
    begun, planned = decisions["step"][1:], decisions["next_step"][:-1]
    assert begun.tolist() == planned.astype(int).tolist()


def test_users_are_seen_at_their_first_detection_and_lost_when_the_patience_is_over():
    stored = run(everything("2 h"))
    for robot, patience in (("astro", 20), ("bolt", 4)):  # 3.5 s are 4 steps
        for user in ("ana", "ben"):
            detected = table(stored, "observations", robot=robot, user=user)["step"]
            expected = []
            for k, step in enumerate(detected.tolist()):
                if k == 0 or step - detected[k - 1] >= patience + 1:
                    expected.append((step, "user_seen"))
                following = detected[k + 1] if k + 1 < len(detected) else 10**9
                if following > step + patience and step + patience < 7200:
                    expected.append((step + patience, "user_lost"))
            events = table(stored, "events", entity=robot, user=user)
            found = list(zip(events["step"].tolist(), events["event"], strict=True))
            assert expected == found
