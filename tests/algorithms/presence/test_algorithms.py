"""Long-term and real-time presence in whole runs: outputs, rows, errors, and what others read."""

import numpy as np
import polars as pl
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


def content(duration="3 h", **algorithms):
    robots = {"astro": {"type": "patrol", "dwell": "20 s"}}
    return scenario(duration, users=USERS, robots=robots, algorithms=algorithms)


@pytest.fixture(scope="module")
def stored():
    """Every estimator in all its variants, and every model, over two midnights."""
    fields = {"type": "long_term_presence", "period": "9 h"}
    algorithms = {}
    for name in ESTIMATORS:
        interval = {} if name == "fremen" else {"interval": 0.9}
        own = {**fields, "estimator": name}
        algorithms[f"e_{name}"] = {**own, **interval}
        algorithms[f"f_{name}"] = {**own, **interval, "half_life": "1 d"}
        algorithms[f"w_{name}"] = {**own, "by": "hour_of_week", "half_life": "1 d"}
    for name in MODELS:
        algorithms[f"m_{name}"] = {"type": "real_time_presence", "model": name, "period": "3 h"}
    return run(content("54 h", **algorithms))


def test_shares_of_each_user_and_hour_sum_to_one(stored):
    for name in stored.manifest["scenario"]["algorithms"]:
        rows = stored.polars(name)
        rooms = rows.filter(pl.col("room") != "away").group_by("step", "user")
        sums = rooms.agg(pl.len(), pl.sum("share"))
        assert {6} == set(sums["len"]), name
        assert [1.0] * len(sums) == pytest.approx(sums["share"].to_list()), name
        away = rows.filter(room="away")["share"]
        assert len(sums) == len(away)
        assert away.is_between(0, 1).all()


@pytest.mark.parametrize("name", sorted({*ESTIMATORS} - {"fremen"}))
def test_intervals_hold_the_estimate_and_are_narrow_after_two_days(stored, name):
    for kind in "ef":
        rows = table(stored, f"{kind}_{name}")
        assert (rows["low"] <= rows["share"] + 1e-12).all()
        assert (rows["share"] <= rows["high"] + 1e-12).all()
        assert (rows["high"] - rows["low"])[rows["step"] == rows["step"].max()].max() < 1
    assert "low" not in table(stored, f"w_{name}")


def test_a_run_is_the_same_with_and_without_other_learners(stored):
    one = {"type": "long_term_presence", "estimator": "likelihood", "interval": 0.9}
    alone = run(content("54 h", e_likelihood={**one, "period": "9 h"}))
    for name in ("e_likelihood", "trajectories"):
        assert digests(stored)[name] == digests(alone)[name]


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


@pytest.mark.parametrize("robots", [{}, {"astro": {"type": "patrol", "camera": None}}])
def test_presence_is_defined_without_users_or_cameras(robots):
    algorithms = {
        "ltp": {"type": "long_term_presence", "estimator": "likelihood"},
        "rtp": {"type": "real_time_presence"},
    }
    rows = table(run(scenario("2 h", robots=robots, algorithms=algorithms)), "ltp")
    assert {"anyone"} == set(rows["user"])
    assert np.isfinite(rows["share"]).all()


def test_a_model_of_ones_own_is_read_by_its_path(tmp_path):
    code = """
import numpy as np
import polars as pl
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
    for name, settings in algorithms.items():
        settings["learned"] = str(tmp_path / "one" / "learned" / f"{name}.npz")
    after = content("1 h", **algorithms)
    known, again = (table(each, "ltp", user="ana")["share"][-7:] for each in (first, run(after)))
    assert known == pytest.approx(again, abs=0.08)
    with pytest.raises(Fleet2DError, match="with these users"):
        run({**after, "users": {"ana": USERS["ana"]}})
