"""Reliability diagrams: forecasts and truth as stored, the same bytes, and other tables refused."""

import math
from contextlib import nullcontext

import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.scenes import run, scenario, table

from fleet2d.errors import ArtifactError
from fleet2d.viewing.pictures import charts
from fleet2d.viewing.pictures.charts import draw_reliability, forecasts_of


@pytest.fixture(scope="module")
def forecast_run():
    users = {
        "ana": {"type": "room_sampling", "shares": {"kitchen": 3, "bedroom": 5, "away": 2}},
        "ben": {"type": "meander"},
    }
    return run(
        scenario(
            "3 h",
            users=users,
            robots={"astro": {"type": "patrol", "dwell": "20 s"}},
            algorithms={
                "rtp": {"type": "real_time_presence"},
                "later": {"type": "belief_table", "period": "1 h", "every": "5 min"},
                "share": {"type": "tests.own_components:Share"},
            },
            metrics={"room_share": {"period": "1 h"}, "score": {"type": "rtp_score", "of": "rtp"}},
            artifacts={"trajectories": "every step"},
        )
    )


def test_forecasts_are_those_stored_and_the_truth_where_users_were(forecast_run):
    belief, truth = forecasts_of(forecast_run, "rtp")
    rooms = [room.name for room in forecast_run.plan.rooms]
    assert (72, len(rooms) + 1) == belief.shape
    assert np.abs(belief.sum(axis=1) - 1).max() < 1e-9
    for number, user in enumerate(("ana", "ben")):
        rows, trajectory = (
            table(forecast_run, "rtp", user=user),
            table(forecast_run, "trajectories", entity=user),
        )
        for k, step in enumerate(range(299, 10800, 300)):
            at_step = rows["step"] == step
            share = dict(zip(rows["room"][at_step], rows["share"][at_step], strict=True))
            row = belief[36 * number + k]
            assert share["away"] == pytest.approx(row[-1])
            assert share["kitchen_1"] * (1 - share["away"]) == pytest.approx(
                row[rooms.index("kitchen_1")]
            )
            place = "away" if trajectory["away"][step] else trajectory["room"][step]
            assert place == [*rooms, "away"][truth[36 * number + k]]


def test_forecasts_that_are_stored_later_are_compared_with_their_own_moment(forecast_run):
    (belief, truth), later = forecasts_of(forecast_run, "rtp"), forecasts_of(forecast_run, "later")
    assert np.array_equal(truth, later.truth)
    assert belief == pytest.approx(later.belief, abs=1e-6)


@pytest.fixture
def figure(monkeypatch):
    """The figure on which charts are drawn, which stays when its file is written."""
    result = Figure()
    monkeypatch.setattr(charts, "picture", lambda *_: nullcontext(result))
    return result


def test_both_panels_have_their_probabilities_at_the_same_places(figure, tmp_path):
    charts.draw_forecasts("rtp", np.eye(3), np.arange(3), tmp_path / "x.png")
    figure.draw_without_rendering()
    curve, counts = (axes.get_window_extent().intervalx for axes in figure.axes)
    np.testing.assert_allclose(curve, counts)


def test_gaps_have_a_panel_for_each_measure_and_a_line_for_each_model(figure, tmp_path):
    gaps = {"0-1 min": (0.5, 0.4, 0.7), "over 4 h": (0.9, math.nan, math.nan)}
    charts.draw_gaps({"log loss": {"routine": gaps, "learned": gaps}}, tmp_path / "x.png")

    [axes] = figure.axes
    assert ["0-1 min", "over 4 h"] == [label.get_text() for label in axes.get_xticklabels()]
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert ["routine", "learned"] == names
    assert [0.5, 0.9] == axes.containers[0].lines[0].get_ydata().tolist()


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("rpt", "no table 'rpt': did you mean 'rtp'"),
        ("room_share", "no room probabilities"),
        ("share", "no room probabilities"),
        ("key_frames", "no room probabilities"),
    ],
)
def test_a_table_without_room_probabilities_is_refused(forecast_run, name, why, tmp_path):
    with pytest.raises(ArtifactError, match=why):
        draw_reliability(forecast_run, name, tmp_path / "x.png")
    assert not (tmp_path / "x.png").exists()
