"""Activities of the survey's categories: which meal, which pastime, at home or away."""

from collections.abc import Iterable, Sequence

from fleet2d.routines.laws import draw_weighted, lognormal
from fleet2d.routines.planner import NO_GAP_S, Doing
from fleet2d.routines.survey import SPREAD, Episode, SurveyGroup, table
from fleet2d.runtime.determinism import Draws

WHOLE = 10_000  # the survey's shares are in parts of this
PLAIN = {
    "sleeping": "sleep", "food_prep": "cook", "laundry": "laundry", "travel": "travel", "tv": "tv",
}  # fmt: skip
# The hours before which a meal has which name; later meals are dinner.
MEALS = ((4, "snack"), (11, "breakfast"), (15, "lunch"), (17, "snack"))


def activities(group: SurveyGroup) -> list[str]:
    """Return the names of the activities that a group's days may have."""
    named = {*PLAIN.values(), "dinner", "work", "work_at_home", "exercise", "sport", "outing"}
    return sorted(named | {meal for _, meal in MEALS} | set(group.facts["other"]))


def draw_works_at_home(group: SurveyGroup, draws: Draws) -> bool:
    """Draw whether a person of a group works at home."""
    return draws.below(WHOLE) < int(group.facts["work_at_home"])


def to_doings(
    group: SurveyGroup, episodes: Iterable[Episode], works_at_home: bool, draws: Draws
) -> Sequence[Doing]:
    """Return the doings of episodes; a doing's task is the survey's category.

    Args:
        group: The person's group.
        episodes: The episodes of the day.
        works_at_home: Whether work is done at home.
        draws: The day's random draws.
    """
    day: list[Doing] = []
    for category, begin, end in episodes:
        if category == "other":
            _add_pastimes(group, day, begin, end, draws)
            continue
        if category == "work":
            name = "work_at_home" if works_at_home else "work"
        elif category == "eating":
            eats_at_home = draws.below(WHOLE) < table()["eat_at_home"]
            name = _meal(begin // 3600 % 24) if eats_at_home else "outing"
        elif category == "exercise":
            exercises_at_home = draws.below(WHOLE) < table()["exercise_at_home"]
            name = "exercise" if exercises_at_home else "sport"
        else:
            name = PLAIN[category]
        day.append(Doing(name, begin, end, category))
    return day


def _meal(hour: int) -> str:
    return next((meal for until, meal in MEALS if hour < until), "dinner")


def _add_pastimes(group: SurveyGroup, day: list[Doing], begin: int, end: int, draws: Draws) -> None:
    """Fill an episode of 'other' with pastimes, by their shares in the survey."""
    pastimes = group.facts["other"]
    names, shares = list(pastimes), [share for share, _ in pastimes.values()]
    while begin < end:
        name = names[draw_weighted(draws, shares)]
        mean_s = pastimes[name][1] * 60
        over = begin + max(NO_GAP_S, lognormal(mean_s, SPREAD * mean_s).draw(draws))
        over = end if over + NO_GAP_S > end else over
        day.append(Doing(name, begin, over, "other"))
        begin = over
