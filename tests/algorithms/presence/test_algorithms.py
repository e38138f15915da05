"""Long-term and real-time presence in whole runs: outputs, rows, errors, and what others read."""

from typing import Any

import numpy as np
import pytest
from tests.scenes import digests, run, scenario, table

import fleet2d
from fleet2d.configuration.components import components
from fleet2d.errors import Fleet2DError

ESTIMATORS, MODELS = (
    sorted(
        n
        for n, c in components(kind).items()
        if c.__module__.startswith("fleet2d.") and n != "onnx"  # needs a file: tests/extras
    )
    for kind in ("presence_estimator", "presence_model")
)
USERS = {
    "ana": {"type": "room_sampling", "shares": {"kitchen": 3, "bedroom": 5, "away": 2}},
    "ben": {"type": "meander"},
}


def content(duration: str = "3 h", **algorithms: Any) -> dict[str, Any]:
    robots = {"astro": {"type": "patrol", "dwell": "20 s"}}
    return scenario(duration, users=USERS, robots=robots, algorithms=algorithms)


@pytest.fixture(scope="module")
def stored():
    """Every estimator and every model, over a midnight."""
    algorithms = {
        f"e_{name}": {"type": "long_term_presence", "estimator": name} for name in ESTIMATORS
    }
    algorithms |= {
        f"m_{name}": {"type": "real_time_presence", "model": name, "period": "1 h"}
        for name in MODELS
    }
    algorithms["week"] = {"type": "long_term_presence", "by": "hour_of_week"}
    algorithms["sure"] = {"type": "long_term_presence", "interval": 0.9}
    return run(content("19 h", **algorithms))


def test_shares_of_each_user_and_hour_sum_to_one(stored):
    names = [f"e_{name}" for name in ESTIMATORS] + [f"m_{name}" for name in MODELS]
    for name in (*names, "week", "sure"):
        rows = table(stored, name)
        for step in np.unique(rows["step"]):
            for user in ("ana", "ben", "anyone"):
                mine = (rows["step"] == step) & (rows["user"] == user)
                assert 7 == mine.sum(), name  # six rooms and away
                at_home = mine & (rows["room"] != "away")
                assert 1.0 == pytest.approx(rows["share"][at_home].sum())
                assert 0 <= rows["share"][mine & (rows["room"] == "away")][0] <= 1


def test_likelihood_finds_a_meandering_user_at_home(stored):
    rows = table(stored, "e_likelihood", user="ben", room="away")
    assert rows["share"][-1] < 0.3
    rows = table(stored, "e_likelihood", user="ana", room="kitchen_1")
    assert rows["share"][-1] > 0.15


def test_intervals_are_columns_and_the_others_have_none(stored):
    rows = table(stored, "sure")
    assert (rows["low"] <= rows["share"]).all()
    assert (rows["share"] <= rows["high"]).all()
    assert "low" not in table(stored, "e_exposure_ratio")


def test_a_run_is_the_same_with_and_without_other_learners(stored):
    alone = run(
        content("19 h", e_likelihood={"type": "long_term_presence", "estimator": "likelihood"})
    )
    assert digests(stored)["e_likelihood"] == digests(alone)["e_likelihood"]
    assert digests(stored)["trajectories"] == digests(alone)["trajectories"]


def test_the_longest_span_changes_nothing():
    digests_by_span = [
        digests(
            run(
                content(
                    "2 h", rtp={"type": "real_time_presence"}, ltp={"type": "long_term_presence"}
                ),
                max_span=span,
            )
        )
        for span in (100, 100_000)
    ]
    assert digests_by_span[0] == digests_by_span[1]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"type": "long_term_presence", "estimator": "sighting"}, "sighting_share"),
        (
            {"type": "long_term_presence", "estimator": {"type": "likelihood", "detection": 1}},
            "detection",
        ),
        ({"type": "long_term_presence", "estimator": {"type": "likelihood", "looks": 1}}, "looks"),
        ({"type": "long_term_presence", "interval": 0.9, "by": "hour_of_week"}, "interval"),
        ({"type": "long_term_presence", "interval": 0.9, "estimator": "fremen"}, "fremen has none"),
        ({"type": "long_term_presence", "half_life": 0}, "half_life"),
        ({"type": "real_time_presence", "model": "psychic"}, "There are: .*hmm, .*hour_of_week"),
        ({"type": "real_time_presence", "model": {"detection": 0.5}}, "'type' is needed"),
    ],
)
def test_wrong_settings_are_refused_with_a_message(settings, words):
    with pytest.raises(Fleet2DError, match=words):
        run(content(mine=settings))


def test_presence_is_defined_without_users_or_cameras():
    for robots in ({}, {"astro": {"type": "patrol", "camera": None}}):
        algorithms = {
            "ltp": {"type": "long_term_presence", "estimator": "likelihood"},
            "rtp": {"type": "real_time_presence"},
        }
        stored = run(scenario("2 h", robots=robots, algorithms=algorithms))
        rows = table(stored, "ltp")
        assert {"anyone"} == set(rows["user"])
        assert np.isfinite(rows["share"]).all()


def test_a_model_of_ones_own_is_read_by_its_path(tmp_path):
    code = """
import numpy as np
from fleet2d.algorithms.presence.model import Model

class Sure(Model):
    '''Everybody is in the first room.'''
    room: int = 0

    def observe(self, bins):
        home = np.zeros((len(bins.day), self.users + 1, self.rooms))
        home[..., self.room] = 1
        return home, np.zeros(home.shape[:2])
"""
    (tmp_path / "mine.py").write_text(code)
    model = {"type": f"{tmp_path.as_posix()}/mine:Sure", "room": 2}
    stored = run(content("1 h", rtp={"type": "real_time_presence", "model": model}))
    rows = table(stored, "rtp", user="ana", share=1.0)
    assert 12 == len(rows["step"])
    assert {"bedroom_1"} == set(rows["room"])


@pytest.mark.slow
def test_a_longer_step_than_a_minute_makes_bins_of_a_step():
    slow = content(
        "2 d",
        ltp={"type": "long_term_presence", "estimator": "likelihood"},
        rtp={"type": "real_time_presence"},
    )
    slow["simulation"] |= {"step": "5 min"}
    slow["artifacts"] |= {"trajectories": "off"}
    assert len(table(fleet2d.run(slow), "rtp")["step"]) == 2 * 288 * 3 * 7


def test_a_run_can_start_from_the_learned_state_of_another(tmp_path):
    algorithms = {
        "ltp": {"type": "long_term_presence", "estimator": "likelihood"},
        "rtp": {"type": "real_time_presence"},
    }
    before = content("1 d", **algorithms)
    before["artifacts"] |= {"learned": True}
    first = fleet2d.run(before, out=tmp_path / "one")
    algorithms = {
        name: {**settings, "learned": str(tmp_path / "one" / "learned" / f"{name}.npz")}
        for name, settings in algorithms.items()
    }
    second = run(content("1 h", **algorithms))
    known = table(first, "ltp", user="ana")["share"][-7:]
    assert known.tolist() == pytest.approx(
        table(second, "ltp", user="ana")["share"].tolist(), abs=0.08
    )
    with pytest.raises(Fleet2DError, match="with these users"):
        run({**content("1 h", **algorithms), "users": {"ana": USERS["ana"]}})


@pytest.mark.slow
def test_every_estimator_has_all_variants_for_everybody():
    """Over all time with intervals and by hour of the week, both also with forgetting."""
    algorithms: dict[str, Any] = {}
    for name in ESTIMATORS:
        for half_life in ("null", "1 d"):
            key = f"{name}_{half_life.replace(' ', '')}"
            fields = {"type": "long_term_presence", "estimator": name, "period": "9 h"}
            fields |= {} if half_life == "null" else {"half_life": half_life}
            algorithms[f"w_{key}"] = {**fields, "by": "hour_of_week"}
            algorithms[f"o_{key}"] = {**fields, **({} if name == "fremen" else {"interval": 0.9})}
    stored = run(content("54 h", **algorithms))
    for name in algorithms:
        for user in ("ana", "ben", "anyone"):
            rows = table(stored, name, user=user)
            last = rows["step"] == rows["step"].max()
            rooms = last & (rows["room"] != "away")
            assert 1.0 == pytest.approx(rows["share"][rooms].sum()), name
            assert 1 == (last & (rows["room"] == "away")).sum()
            if "low" in rows:
                assert (rows["low"] <= rows["share"] + 1e-12).all(), name
                assert (rows["share"] <= rows["high"] + 1e-12).all(), name
                assert (rows["high"] - rows["low"])[last].max() < 1
        assert ("low" in rows) == (name.startswith("o_") and "fremen" not in name)
