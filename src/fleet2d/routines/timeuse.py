"""From the survey's categories to activities: which meal, which pastime, at home or away."""

from collections.abc import Iterable, Sequence

from fleet2d.routines.laws import lognormal, weighted
from fleet2d.routines.planner import NO_GAP_S, Doing
from fleet2d.routines.survey import SPREAD, Block, Group, table
from fleet2d.streams import Draws

WHOLE = 10_000  # the survey's shares are parts of that
PLAIN = {
    "sleeping": "sleep", "food_prep": "cook", "laundry": "laundry", "travel": "travel", "tv": "tv",
}  # fmt: skip
# Up to which hour a meal is which; later than the last: dinner.
MEALS = ((4, "snack"), (11, "breakfast"), (15, "lunch"), (17, "snack"))


def activities(group: Group) -> list[str]:
    """Return the names of the activities that a group's days may hold."""
    named = {*PLAIN.values(), "dinner", "work", "work_at_home", "exercise", "sport", "outing"}
    return sorted(named | {meal for _, meal in MEALS} | set(group.facts["other"]))


def works_at_home(group: Group, draws: Draws) -> bool:
    """Draw whether somebody of a group works at home."""
    return draws.below(WHOLE) < int(group.facts["work_at_home"])


def told_apart(
    group: Group, blocks: Iterable[Block], at_home: bool, draws: Draws
) -> Sequence[Doing]:
    """Return what is done in each block; a doing's task is the survey's category.

    Args:
        group: Whose pastimes.
        blocks: The day, in the survey's categories.
        at_home: Whether work is done at home.
        draws: The day's random draws.
    """
    day: list[Doing] = []
    for category, begin, end in blocks:
        if category == "other":
            _add_pastimes(group, day, begin, end, draws)
            continue
        if category == "work":
            name = "work_at_home" if at_home else "work"
        elif category == "eating":
            at_table = draws.below(WHOLE) < table()["eat_at_home"]
            name = _meal(begin // 3600 % 24) if at_table else "outing"
        elif category == "exercise":
            indoors = draws.below(WHOLE) < table()["exercise_at_home"]
            name = "exercise" if indoors else "sport"
        else:
            name = PLAIN[category]
        day.append(Doing(name, begin, end, category))
    return day


def _meal(hour: int) -> str:
    return next((meal for until, meal in MEALS if hour < until), "dinner")


def _add_pastimes(group: Group, day: list[Doing], begin: int, end: int, draws: Draws) -> None:
    """Fill a block of 'other' with what it is made of in the survey."""
    made_of = group.facts["other"]
    names, shares = list(made_of), [share for share, _ in made_of.values()]
    while begin < end:
        name = names[weighted(draws, shares)]
        mean_s = made_of[name][1] * 60
        over = begin + max(NO_GAP_S, lognormal(mean_s, SPREAD * mean_s).draw(draws))
        over = end if over + NO_GAP_S > end else over
        day.append(Doing(name, begin, over, "other"))
        begin = over
