"""Fig. 7 right: how often the room of a user is right, by the time since the last sighting.

Real-time presence by several models and by the naive guess (the room of the last sighting) is
scored every minute: the share of right rooms, and the log loss, which is a proper score. The result
is the mean over seeds with its bootstrap interval; each seed is a month of another life with a
robot on patrol.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from fleet2d.metrics.rtp_score import ALL, GAPS
from fleet2d.paper.months import USER, OnProgress, PaperOptions, interval, month, run_study
from fleet2d.paper.result import Result, Table, counted

if TYPE_CHECKING:
    from fleet2d.studies.reader import Study

NAME = "rtp-gap"
TITLE = "Fig. 7 right: accuracy of real-time presence by last-seen gap"
MODELS = ("routine", "hmm", "semi_markov", "markov", "hour_of_week", "long_term")
NAIVE = "naive"
SCORES = {"top_1": "share of right rooms", "log_loss": "log loss [nats], smaller is better"}
PAPER = (
    "the paper's figure: a model's accuracy above that of the naive guess, the more so the longer"
    " the user was out of sight; its numbers are not printed",
)

Scores = dict[str, dict[str, dict[str, float]]]
"""Scores of one life: by model, gap and name of the score."""
Means = dict[str, dict[str, dict[str, tuple[float, float, float]]]]
"""Means with the ends of their intervals: by name of the score, model and gap."""


def study_of(seeds: int, days: int) -> dict[str, Any]:
    """Return the study: one life for each seed, with all models; the patrol uses none of them."""
    base = month(
        {"type": "patrol", "order": "random", "dwell": "5 min"},
        algorithms={
            model: {"type": "real_time_presence", "model": model, "period": "1 h"}
            for model in MODELS
        },
        metrics={
            f"score_{model}": {"type": "rtp_score", "of": model, "period": "1 h"}
            for model in MODELS
        },
        days=days,
    )
    return {"base": base, "replicates": seeds, "keep": {"metrics": [f"score_*.{USER}.*"]}}


def scores(study: "Study") -> list[Scores]:
    """Return the scores of each life by model and gap, the naive guess as one more model."""
    return [_scores_of(row) for row in study.variants.to_dicts()]


def _scores_of(row: Mapping[str, Any]) -> Scores:
    of_model: Scores = {name: {} for name in (*MODELS, NAIVE)}
    for model in MODELS:
        for gap in (*GAPS, ALL):
            prefix = f"score_{model}.{USER}.{gap}"
            if row.get(f"{prefix}.top_1") is not None:
                of_model[model][gap] = {score: row[f"{prefix}.{score}"] for score in SCORES}
    for gap in of_model[MODELS[0]]:
        prefix = f"score_{MODELS[0]}.{USER}.{gap}"
        of_model[NAIVE][gap] = {score: row[f"{prefix}.naive_{score}"] for score in SCORES}
    return of_model


def means(lives: list[Scores]) -> Means:
    """Return the mean of each score over seeds, with its interval."""
    return {
        score: {
            name: {
                gap: interval(life[name][gap][score] for life in lives if gap in life[name])
                for gap in (*GAPS, ALL)
                if any(gap in life[name] for life in lives)
            }
            for name in (*MODELS, NAIVE)
        }
        for score in SCORES
    }


def reproduce(options: PaperOptions, on_progress: OnProgress) -> Result:
    """Run all months; return the tables of scores."""
    seeds, days = options.size(10, 30, 2, 3)
    lives = scores(run_study(NAME, study_of(seeds, days), options, on_progress))
    by_score = means(lives)
    tables = tuple(
        Table(
            f"{title}; {counted(seeds, 'seed')} of {counted(days, 'day')}",
            ("model", *GAPS, ALL),
            tuple(
                (name.replace("_", " "), *(_cell(by_gap.get(gap)) for gap in (*GAPS, ALL)))
                for name, by_gap in by_score[score].items()
            ),
            PAPER if score == "top_1" else (),
        )
        for score, title in SCORES.items()
    )
    numbers = {"seeds": seeds, "days": days, "means": by_score, "scores": lives}
    return Result(NAME, TITLE, tables, numbers)


def _cell(value: tuple[float, float, float] | None) -> str:
    return "" if value is None else f"{value[0]:.3f}"
