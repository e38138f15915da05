"""Needs and errands: what interrupts the planned days of people."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from functools import cache, lru_cache
from typing import Annotated, NamedTuple

from pydantic import Field

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.configuration.schema_forms import SchemaForms
from fleet2d.configuration.units import Duration, Share, TimeOfDay
from fleet2d.kernels import CHANCE_BITS, QUANTILE_BITS, Interruptions
from fleet2d.routines import planner
from fleet2d.routines.activity import (
    Activity,
    AnyDurationDistribution,
    DurationDistribution,
    bundled,
    seconds,
)
from fleet2d.routines.distributions import Distribution
from fleet2d.routines.planner import PLANNED, RESUMES, SLEEP, Episode, PrivateRooms
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.determinism import Draws

# The shortest mean time between two occurrences of a need.
SHORTEST_INTERVAL = timedelta(minutes=5)


class Need(Settings):
    """Something that builds up, and then interrupts an activity, which is resumed afterwards.

    Short form: ``2 h`` is a need with that mean time between two occurrences.

    Attributes:
        activity: The activity; left out: the name of the need.
        every: Time awake between two occurrences.
        asleep: Time asleep until it wakes the person; left out: it never does.
        on_waking: Probability that it is met first on waking.
        before_bed: Probability that it is met last before sleep.
        before_leaving: Probability that it is met last before leaving home.
        on_return: Probability that it is met first on coming home.
        between: The times of day at which it occurs; left out: at any.
        met_by: Activities that meet it, too: it builds up again after them.
        takes: Its duration; left out: that of the activity.
        then: Activities that follow at once, with their probability.
        patience: It waits for the end of an activity that ends within this time.
        source: The source of its numbers, for readers.
    """

    short_form = ("every", (str, int, float, timedelta))

    activity: str = ""
    every: AnyDurationDistribution
    asleep: AnyDurationDistribution | None = None
    on_waking: Share = 0.0
    before_bed: Share = 0.0
    before_leaving: Share = 0.0
    on_return: Share = 0.0
    between: tuple[TimeOfDay, TimeOfDay] | None = None
    met_by: tuple[str, ...] = ()
    takes: AnyDurationDistribution | None = None
    then: dict[str, Share] = Field(default_factory=dict)
    patience: Duration = timedelta(minutes=10)
    source: str = ""

    def model_post_init(self, _: object, /) -> None:
        """Refuse needs that leave no time between two."""
        for key, waits in (("every", self.every), ("asleep", self.asleep)):
            if waits is not None and waits.table().mean() < seconds(SHORTEST_INTERVAL):
                raise problem(f"'{key}' is less than 5 min on average: make it 5 min or longer")


class Errand(Settings):
    """A short task between two activities: to fetch, put away or look at something.

    Short form: a number is its probability.

    Attributes:
        activity: The activity; left out: the name of the errand.
        probability: Its probability at each such change of activity.
        after: Activities after which it is done; left out: after any.
        before: Activities before which it is done; left out: before any.
        takes: Its duration; left out: that of the activity.
        source: The source of its numbers, for readers.
    """

    short_form = ("probability", (int, float))

    activity: str = ""
    probability: Share
    after: tuple[str, ...] = ()
    before: tuple[str, ...] = ()
    takes: AnyDurationDistribution | None = None
    source: str = ""


AnyNeed = Annotated[Need, SchemaForms("text", "number")]
AnyErrand = Annotated[Errand, SchemaForms("number")]


@cache
def usual_needs() -> dict[str, Need]:
    """Return the needs of an adult, which personas without needs of their own have.

    >>> sorted(usual_needs())
    ['call', 'drink', 'freshen_up', 'pick_up', 'toilet']
    """
    return bundled(Need, "needs.yaml", "needs")


@cache
def population_needs() -> dict[str, Need]:
    """Return the needs of people of the survey: an adult's, and a meal that it doesn't record."""
    return {**usual_needs(), **bundled(Need, "needs.yaml", "population")}


@cache
def usual_errands() -> dict[str, Errand]:
    """Return the errands of an adult, which personas without errands of their own have."""
    return bundled(Errand, "needs.yaml", "errands")


def activities_of(needs: Mapping[str, Need], errands: Mapping[str, Errand]) -> set[str]:
    """Return the names of the activities of needs and errands."""
    names = {need.activity or name for name, need in needs.items()}
    names |= {what for need in needs.values() for what in need.then}
    return names | {errand.activity or name for name, errand in errands.items()}


def named_activities(
    needs: Mapping[str, Need], errands: Mapping[str, Errand]
) -> list[tuple[tuple[str, ...], str]]:
    """Return pairs of keys in the persona and the activity that needs and errands name there."""
    named: list[tuple[tuple[str, ...], str]] = []
    for name, need in needs.items():
        named.append((("needs", name), need.activity or name))
        named += [(("needs", name, "then", what), what) for what in need.then]
        named += [(("needs", name, "met_by"), what) for what in need.met_by]
    for name, errand in errands.items():
        named.append((("errands", name), errand.activity or name))
        named += [(("errands", name, "after"), what) for what in errand.after]
        named += [(("errands", name, "before"), what) for what in errand.before]
    return named


Quantiles = tuple[int, ...]
StepRow = tuple[int, int, Quantiles]


class InterruptionRules(NamedTuple):
    """What interrupts the days of a person.

    Attributes:
        core: The needs and errands, by numbers of activities.
        names: The activities by number.
        numbers: The number of each of them.
        exclusive: Activities that are done alone in their room.
    """

    core: Interruptions
    names: tuple[str, ...]
    numbers: Mapping[str, int]
    exclusive: frozenset[str]


def interruption_rules(
    needs: Mapping[str, Need], errands: Mapping[str, Errand], activities: Mapping[str, Activity]
) -> InterruptionRules:
    """Return the rules of needs and errands.

    Args:
        needs: The needs, by name.
        errands: The errands, by name.
        activities: All activities that a day may have, with those of needs and errands.
    """
    numbers = {name: number for number, name in enumerate(activities)}

    def step(name: str, chance: float, duration: DurationDistribution | None = None) -> StepRow:
        return numbers[name], _chance(chance), _quantiles(duration or activities[name].takes)

    def of(names: Sequence[str]) -> list[int] | None:
        return sorted({numbers[name] for name in names}) or None

    need_rows = []
    for name, need in needs.items():
        steps = [step(need.activity or name, 1.0, need.takes)]
        steps += [step(then, chance) for then, chance in need.then.items()]
        every = _quantiles(need.every)
        asleep = None if need.asleep is None else _quantiles(need.asleep)
        chances = (
            _chance(need.on_waking),
            _chance(need.before_bed),
            _chance(need.before_leaving),
            _chance(need.on_return),
        )
        patience = seconds(need.patience)
        hours = None if need.between is None else _hours(need.between)
        met_by = of(need.met_by) or []
        need_rows.append((steps, every, asleep, chances, patience, hours, met_by))
    errand_rows = []
    for name, errand in errands.items():
        own = step(errand.activity or name, errand.probability, errand.takes)
        errand_rows.append((own, of(errand.after), of(errand.before)))
    away = [numbers[name] for name, activity in activities.items() if activity.away]
    exclusive = frozenset(name for name, activity in activities.items() if activity.exclusive)
    firm = [numbers[n] for n, a in activities.items() if a.exclusive or not a.interruptible]
    core = Interruptions(need_rows, errand_rows, away, firm, numbers[SLEEP], len(numbers))
    return InterruptionRules(core, tuple(activities), numbers, exclusive)


def _hours(between: tuple[timedelta, timedelta]) -> tuple[int, int]:
    """Return the begin of some hours of the day [s since midnight], and how long they last [s]."""
    return seconds(between[0]), seconds(between[1] - between[0]) % DAY_S


def _chance(share: float) -> int:
    """Return a probability in parts of 1024."""
    return round(share * (1 << CHANCE_BITS))


def _quantiles(distribution: DurationDistribution) -> Quantiles:
    """Return quantiles of a distribution between its bounds [s]."""
    return _quantiles_of(distribution.table())


@lru_cache(maxsize=256)  # people of one persona share them
def _quantiles_of(table: Distribution) -> Quantiles:
    return tuple(max(1, value) for value in table.quantiles(1 << QUANTILE_BITS))


def interrupt(
    rules: InterruptionRules,
    draws: Draws,
    day: Sequence[Episode],
    private: PrivateRooms | None = None,
) -> list[Episode]:
    """Return a day with interruptions.

    Each lies within one activity, which is resumed afterwards: all activities of the plan begin and
    end as planned. A day's interruptions are a function of its date and its plan alone.

    Args:
        rules: The needs and errands of the person.
        draws: The random draws of the day's interruptions.
        day: The planned day, without a gap.
        private: The rooms that others may use; None: nobody does.
    """
    rows = [(rules.numbers[name], begin, end, room) for name, begin, end, _, room, _ in day]
    use = None
    rooms = list[Sequence[int]]()
    if private is not None:
        use = private.use
        rooms = [private.of(name) if name in rules.exclusive else () for name in rules.names]
    episodes = []
    for planned, number, begin, end, role, room in rules.core.interrupt(draws, rows, use, rooms):
        if planned < 0:
            episode = planner.new_episode((rules.names[number], begin, end, "", room, role))
        else:
            episode = _part(day[planned], begin, end, role)
        episodes.append(episode)
    return episodes


def _part(episode: Episode, begin: int, end: int, role: int) -> Episode:
    """Return a part of a planned episode."""
    if begin == episode.begin and end == episode.end:
        return episode
    role = episode.role if role == PLANNED else role
    return planner.new_episode((episode.activity, begin, end, episode.task, episode.room, role))


def without_interruptions(day: Sequence[Episode]) -> list[Episode]:
    """Return a day as it was planned, without its interruptions."""
    planned: list[Episode] = []
    begin = day[0].begin
    for episode in day:
        if episode.role == planner.INTERRUPTS:
            continue
        resumes = episode.role == RESUMES and planned and planned[-1].activity == episode.activity
        if episode.role == planner.FINISHES or resumes:
            planned[-1] = planned[-1]._replace(end=episode.end)
        else:
            planned.append(episode._replace(begin=begin))
        begin = episode.end
    return planned
