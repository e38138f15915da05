"""Population: days whose activities follow the American Time Use Survey."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Literal

from fleet2d.entities.behavior import Actor
from fleet2d.entities.place import Point, RoomChoice
from fleet2d.entities.users.resident import ResidentBehavior, rooms_at
from fleet2d.routines import interruptions, survey
from fleet2d.routines.activity import catalogue
from fleet2d.routines.distributions import draw_weighted
from fleet2d.routines.planner import REST, Episode
from fleet2d.runtime.determinism import Draws, stream_key
from fleet2d.runtime.local_time import written


class Population(ResidentBehavior):
    """Live as a person drawn from the American Time Use Survey 2022-2023.

    Among many such people, the share that does each activity at each hour is that of the survey,
    for weekdays and weekends. The durations of activities follow their means in the survey. A
    person has no habits: every day is drawn independently.

    Attributes:
        group: Group of people; any: drawn by the groups' shares of the people.
    """

    group: Literal["any", "workers", "retired", "working_parents", "at_home"] = "any"

    def start(self, actor: Actor) -> None:
        """Draw the person's group, and find where the activities are done in the home."""
        self.days = actor.stream("day")
        self.details = actor.stream("details")
        draws = Draws(actor.stream("who"), 0)
        group: str = self.group
        if group == "any":  # drawn by the group's share of people
            names = survey.groups()
            groups = survey.table()["groups"]
            shares = [groups[name]["share"] for name in names]
            group = names[draw_weighted(draws, shares)]
        self.people = survey.group(group)
        self.works_at_home = survey.draw_works_at_home(self.people, draws)
        self.first = actor.clock.start.toordinal() - 1
        self.states = [survey.first_state(self.people, draws, self.first)]
        self.cache: dict[int, Sequence[Episode]] = {}
        known = catalogue()
        used = {*survey.activities(self.people), REST}
        self.interruptions = actor.stream("needs")
        # The survey counts bodily needs, short errands, and a meal after hours without one as part
        # of the interrupted activity.
        needs = interruptions.population_needs()
        errands = interruptions.usual_errands()
        self.rules = interruptions.interruption_rules(needs, errands, known)
        used |= interruptions.activities_of(needs, errands)
        doing = {name: known[name].model_copy(update={"fetches": None}) for name in sorted(used)}
        self.settle(actor, doing, self.make_spots(actor))

    def begins_at(self, time: datetime) -> RoomChoice | Point | None:
        """Return the rooms of a typical activity of such people at the beginning of the run."""
        draws = Draws(stream_key(0, "", "likely"), 0)
        known = catalogue()
        group = survey.groups()[0] if self.group == "any" else self.group
        people = survey.group(group)
        time = written(time)
        ordinal = (time - timedelta(seconds=survey.DAWN_S)).toordinal()
        state = survey.first_state(people, draws, ordinal)
        episodes, _ = survey.draw_episodes(people, draws, ordinal, state)
        time_s = (time - datetime.fromordinal(ordinal)) // timedelta(seconds=1)
        activities = survey.to_activities(people, episodes, False, draws)
        return rooms_at(activities, time_s, known)

    def day(self, ordinal: int) -> Sequence[Episode]:
        """Return the episodes from 04:00 on the day of a date's ordinal to 04:00 on the next."""
        if ordinal not in self.cache:
            while len(self.states) <= ordinal - self.first:
                self._live(self.first + len(self.states) - 1)
            self.cache = {ordinal: self._live(ordinal)}
        return self.cache[ordinal]

    def _live(self, ordinal: int) -> Sequence[Episode]:
        people = self.people
        state = self.states[ordinal - self.first]
        episodes, after = survey.draw_episodes(people, Draws(self.days, ordinal), ordinal, state)
        if len(self.states) == ordinal - self.first + 1:
            self.states.append(after)
        details = Draws(self.details, ordinal)
        day = survey.to_activities(people, episodes, self.works_at_home, details)
        return interruptions.interrupt(self.rules, Draws(self.interruptions, ordinal), day)
