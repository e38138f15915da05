"""The rules of interruptions: needs and errands in the form in which days are drawn from them."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from fleet2d.kernels.motion import Interruptions
from fleet2d.routines.activity import Activity, seconds
from fleet2d.routines.laws import Law
from fleet2d.routines.needs import Errand, Need
from fleet2d.routines.planner import DAY_S, SLEEP

# Probabilities have this many bits, and laws 2 to this power quantiles: few bits of a draw suffice.
CHANCE_BITS, QUANTILE_BITS = 10, 8
CERTAIN = 1 << CHANCE_BITS

Quantiles = tuple[int, ...]


class InterruptionStep(NamedTuple):
    """One activity of an interruption.

    Attributes:
        activity: The activity.
        chance: Its probability, in parts of CERTAIN.
        takes: Quantiles of its duration [s].
        exclusive: Whether it needs a room that no other member of the household uses.
    """

    activity: str
    chance: int
    takes: Quantiles
    exclusive: bool


class NeedRule(NamedTuple):
    """A need in the form used here; probabilities in parts of CERTAIN, times in seconds."""

    steps: tuple[InterruptionStep, ...]
    every: Quantiles
    asleep: Quantiles | None
    on_waking: int
    before_bed: int
    before_leaving: int
    on_return: int
    patience: int
    window: tuple[int, int] | None
    met_by: frozenset[str]


class ErrandRule(NamedTuple):
    """An errand in the form used here."""

    step: InterruptionStep
    after: frozenset[str]
    before: frozenset[str]


class InterruptionRules(NamedTuple):
    """What interrupts the days of a person.

    Attributes:
        needs: The needs of the person.
        errands: The errands of the person.
        away: Activities out of the home.
        uninterruptible: Activities that needs don't interrupt.
        private: Exclusive activities, which are done alone in their room.
        names: All activities.
        numbers: The number of each of them.
        core: The same rules by numbers, for days in which nobody else uses private rooms.
    """

    needs: tuple[NeedRule, ...]
    errands: tuple[ErrandRule, ...]
    away: frozenset[str]
    uninterruptible: frozenset[str]
    private: frozenset[str]
    names: tuple[str, ...]
    numbers: Mapping[str, int]
    core: Interruptions


def interruption_rules(
    needs: Mapping[str, Need], errands: Mapping[str, Errand], activities: Mapping[str, Activity]
) -> InterruptionRules:
    """Return the rules of needs and errands.

    Args:
        needs: The needs, by name.
        errands: The errands, by name.
        activities: All activities that a day may have, with those of needs and errands.
    """
    need_rules = tuple(_need_rule(name, need, activities) for name, need in needs.items())
    errand_rules = tuple(
        ErrandRule(
            _step(errand.activity or name, errand.probability, errand.takes, activities),
            frozenset(errand.after),
            frozenset(errand.before),
        )
        for name, errand in errands.items()
    )
    away = frozenset(name for name, activity in activities.items() if activity.away)
    firm = frozenset(n for n, a in activities.items() if a.exclusive or not a.interruptible)
    private = frozenset(name for name, activity in activities.items() if activity.exclusive)
    names = tuple(activities)
    numbers = {name: number for number, name in enumerate(names)}
    core = in_numbers(need_rules, errand_rules, away, firm, numbers)
    return InterruptionRules(need_rules, errand_rules, away, firm, private, names, numbers, core)


def in_numbers(
    needs: Sequence[NeedRule],
    errands: Sequence[ErrandRule],
    away: Collection[str],
    uninterruptible: Collection[str],
    numbers: Mapping[str, int],
) -> Interruptions:
    """Return rules as the core has them."""

    def of(names: Collection[str]) -> list[int]:
        return [number for name, number in numbers.items() if name in names]

    def some(names: Collection[str]) -> list[int] | None:
        return of(names) if names else None

    def step(rule: InterruptionStep) -> tuple[int, int, Quantiles]:
        return numbers[rule.activity], rule.chance, rule.takes

    need_rows = [
        (
            [step(each) for each in need.steps],
            need.every,
            need.asleep,
            (need.on_waking, need.before_bed, need.before_leaving, need.on_return),
            need.patience,
            need.window,
            of(need.met_by),
        )
        for need in needs
    ]
    errand_rows = [(step(rule.step), some(rule.after), some(rule.before)) for rule in errands]
    return Interruptions(
        need_rows, errand_rows, of(away), of(uninterruptible), numbers[SLEEP], len(numbers)
    )


def _need_rule(name: str, need: Need, activities: Mapping[str, Activity]) -> NeedRule:
    steps = [_step(need.activity or name, 1.0, need.takes, activities)]
    steps += [_step(then, chance, None, activities) for then, chance in need.then.items()]
    window = None
    if need.between is not None:
        first = seconds(need.between[0])
        window = first, (seconds(need.between[1]) - first) % DAY_S
    return NeedRule(
        tuple(steps),
        _quantiles(need.every.table()),
        None if need.asleep is None else _quantiles(need.asleep.table()),
        _chance(need.on_waking),
        _chance(need.before_bed),
        _chance(need.before_leaving),
        _chance(need.on_return),
        seconds(need.patience),
        window,
        frozenset(need.met_by),
    )


def _chance(share: float) -> int:
    """Return a probability in parts of CERTAIN."""
    return round(share * CERTAIN)


def _step(
    name: str, chance: float, takes: object, activities: Mapping[str, Activity]
) -> InterruptionStep:
    activity = activities[name]
    law = (takes or activity.takes).table()  # type: ignore[attr-defined]
    return InterruptionStep(name, _chance(chance), _quantiles(law), activity.exclusive)


def _quantiles(law: Law) -> Quantiles:
    """Return quantiles of a law between its bounds [s]."""
    return tuple(max(1, value) for value in law.quantiles(1 << QUANTILE_BITS))
