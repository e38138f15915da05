"""Conversations: requests of robots come up, people are addressed, and they answer.

Conversations follow from the poses and plans alone, step by step, so they don't depend on spans. A
span ends with each question and answer, and with each request for which a robot's plan waits.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime, timedelta
from typing import NamedTuple

from fleet2d.configuration.units import micros
from fleet2d.engine.basis import Basis, PlannedNote, Watcher, notes_of
from fleet2d.engine.intervention_queue import InterventionQueue
from fleet2d.entities.behavior import Command, SightEvent
from fleet2d.entities.body import NEVER, Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.plan import Note
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.interactions.answers import (
    ASLEEP,
    AnswerRecord,
    Answers,
    Circumstances,
    Initiative,
    Reply,
    Wanted,
)
from fleet2d.interactions.attitude import AttitudeState
from fleet2d.interactions.interaction import Interaction, Outcome, Request, RequestQueue
from fleet2d.kernels import TURN, PoseBlock, heading_of, line_of_sight
from fleet2d.runtime.clock import DAY, midnight_of
from fleet2d.runtime.determinism import Draws
from fleet2d.runtime.events import Event, EventKind

LYING = POSTURES.index("lie")
# From farther away, nobody is addressed, and nobody notices [m].
EARSHOT_M = 8.0
# Half of the field in which a person sees a robot: 100° [1/4096 turn].
FRONT = TURN * 100 // 360


class PendingReply(NamedTuple):
    """An answer that is given at the end of a step."""

    step: int
    robot: int
    text: str
    reply: Reply


class DueStart(NamedTuple):
    """A contact that a person starts with a robot at a step: a call, a question, a complaint."""

    step: int
    user: int
    robot: int
    kind: str


class RoomBan(NamedTuple):
    """A room from which a robot is banned until a step."""

    until: int
    robot: int
    room: int


class Conversations(Watcher):
    """The watcher of all questions and answers of a run.

    Attributes:
        actors: All bodies: users, then robots.
        users: Number of users.
        queues: The requests of each robot, by its row.
        answers: The model of each user's answers, by row.
        attitudes: The attitude of each user to each robot: truth, by their rows.
        log: The answers of people: truth, for metrics.
        wanted: The requests that came up, for metrics.
    """

    def __init__(self, basis: Basis, interventions: InterventionQueue) -> None:
        """Set up the conversations of a scenario, and give each robot its queue.

        Args:
            basis: The basis of the run.
            interventions: The queue of interventions, by which people switch robots off.
        """
        self.actors = basis.actors
        self.users = basis.bodies.users
        self._clock = basis.clock
        self.queues: dict[int, RequestQueue] = {}
        self.answers: dict[int, Answers] = {}
        self.attitudes: dict[tuple[int, int], AttitudeState] = {}
        self.log: list[AnswerRecord] = []
        self.wanted: list[Wanted] = []
        self._interventions = interventions
        self._activity: dict[int, str] = {}  # activity of each user before the present plan
        self._questions: list[PlannedNote] = []  # at the ends of plans that were replaced
        self._replies: list[PendingReply] = []
        self._last: list[tuple[int, SightEvent]] = []
        self._next: int | None = None  # the next step that ends a span; None: unknown
        self._agenda = 0  # the next step with an answer, the end of a ban, or a start
        self._changes: dict[int, dict[str, int]] = {}  # by queue: when requests come up next
        self._initiators: list[tuple[int, int]] = []  # users who start something, and robots
        self._starts: list[DueStart] = []  # starts of today
        self._begun_days = 0
        # The request that was accepted last, and its step, by robot.
        self._accepted: dict[int, tuple[Request, int]] = {}
        self._bans: list[RoomBan] = []
        self._open(basis)

    def _open(self, basis: Basis) -> None:
        rows = {actor.name: row for row, actor in enumerate(basis.actors)}
        wanted: dict[int, dict[str, Interaction]] = {}
        for name, interaction in basis.scenario.interactions.items():
            by = interaction.by or next(iter(basis.scenario.robots))
            wanted.setdefault(rows[by], {})[name] = interaction
        declared = [basis.scenario.users[actor.name].answers for actor in basis.users]
        if any(answers and answers.initiative != Initiative() for answers in declared):
            wanted |= {row: wanted.get(row, {}) for row in range(self.users, len(basis.actors))}
        people = [answers or Answers() for answers in declared] if wanted else []
        for row, interactions in wanted.items():
            queue = RequestQueue(interactions, basis.clock.start)
            self.queues[row] = basis.actors[row].requests = queue
            for user, answers in enumerate(people):
                self.answers[user] = answers
                self.attitudes[user, row] = answers.months.begin(basis.clock.start)
                if answers.initiative != Initiative():
                    _check_answers_calls(basis.actors[user], basis.actors[row], answers)
                    self._initiators.append((user, row))

    @property
    def is_needed(self) -> bool:
        """Whether any robot has requests to people."""
        return bool(self.queues)

    waits = is_needed

    def before_plan(self, row: int, actor: DecidingActor, step: int) -> None:
        """Record the completed part of a plan that is replaced at a step."""
        if row < self.users:
            self._activity[row] = self._activity_at(row, step)
        elif row in self.queues:
            self._next = None
            self._questions += [q for q in notes_of(actor, EventKind.ASKS) if q.step == step]

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the first question or answer, or request that a robot hears of."""
        if self._next is None:
            self._next = self._next_step()
        return min(end, self._next + 1)

    def _next_step(self) -> int:
        """Return the next step with an event that ends a span."""
        steps = [self._agenda, *(question.step for question in self._questions)]
        for row, changes in self._changes.items():
            robot = self.actors[row]
            heard = self.awaited | robot.plan.interrupts
            steps += [at for kind, at in changes.items() if kind in heard]
            if robot.plan.notes:
                steps += [question.step for question in notes_of(robot, EventKind.ASKS)]
        return min(step for step in steps if step >= self.next_step)

    def _look_ahead(self) -> None:
        """Note the next event that doesn't depend on the plans of robots."""
        steps = [NEVER, *(reply.step for reply in self._replies)]
        steps += [start.step for start in self._starts]
        steps += [ban.until for ban in self._bans]
        if self._initiators:
            steps.append(self._day_begin(self._begun_days))
        self._agenda = max(min(steps), self.next_step)
        self._next = None
        for row, queue in self.queues.items():
            steps_of = {kind: self._step_of(time) for kind, time in queue.next_changes().items()}
            self._changes[row] = {k: max(step, self.next_step) for k, step in steps_of.items()}

    def _step_of(self, time: datetime) -> int:
        return self._clock.step_at_or_after(self._clock.elapsed(time))

    def _steps_in(self, duration: timedelta) -> int:
        return max(1, micros(duration) // self._clock.step_us)

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Process the steps up to `end` - 1; before the last one, only requests change."""
        first = self.next_step
        self.next_step = end
        self._last = []
        if end == first:
            return ()
        events: list[Event] = []
        for row, queue in self.queues.items():
            name = self.actors[row].name
            for at, text in queue.take_opportunities():
                events.append(Event(at, name, EventKind.OPPORTUNITY, text))
        step = end - 1
        if self._is_quiet(step):
            return events
        for row, queue in self.queues.items():
            events += self._change_requests(row, queue, first, step)
            robot = self.actors[row]
            asked = [*notes_of(robot, EventKind.ASKS), *self._questions]
            for question in dict.fromkeys(asked):
                if question.step == step and question.row == row:
                    self._ask(question, bodies.block(step, end + 1))
        self._questions = []
        events += self._end_bans(step)
        events += self._start(step, bodies)
        for pending in [reply for reply in self._replies if reply.step <= step]:
            self._replies.remove(pending)
            events += self._give(pending, step, bodies)
        self._look_ahead()
        return events

    def _is_quiet(self, step: int) -> bool:
        """Return whether no question, answer or change of requests happens up to a step."""
        if self._next is None or step >= self._next:
            return False
        return all(
            step < min(changes.values(), default=NEVER) for changes in self._changes.values()
        )

    def _change_requests(
        self, row: int, queue: RequestQueue, first: int, step: int
    ) -> Iterator[Event]:
        """Open and drop requests of a robot, and yield the events."""
        name = self.actors[row].name
        for change in queue.advance(self._clock.time(step)):
            at = max(self._step_of(change.time), first)
            interaction = change.request.interaction
            text = f"{change.request.name} {interaction.to}"
            if change.event == EventKind.DUE:
                self.wanted.append(Wanted(at, name, text, interaction))
            self._tell(row, change.event, text)
            yield Event(at, name, change.event, text)

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Yield the robots whose plans waited for an answer or a request, with the event."""
        for row, event in self._last:
            if event.event in self.actors[row].plan.interrupts:
                yield row, event

    def _tell(self, row: int, event: str, text: str) -> None:
        self._last.append((row, SightEvent(event, text, *self.actors[row].xy)))

    def _ask(self, question: PlannedNote, block: PoseBlock) -> None:
        """Let the addressed person notice the robot, and draw the answer."""
        name, _, meant = question.text.rpartition(" ")
        interaction = self.queues[question.row].interactions.get(name)
        user = self._addressed(question.row, meant, block)
        if interaction is None or user is None:
            self._note(question, "", "", None, None)
            return
        person = self.actors[user]
        state = self.attitudes[user, question.row]
        answers = self.answers[user]
        now = self._circumstances(user, question, interaction, block)
        answers.months.pass_time(state, now.time)
        reply = answers.reply(now, state, person.seed, person.path, question.step)
        if reply is not None and person.name != meant:
            reply = reply._replace(outcome=Outcome.MISTAKEN)
        if reply is not None:
            answers.months.addressed(state, name, reply.outcome, reply.willingness)
            step = question.step + self._steps_in(reply.delay)
            self._replies.append(PendingReply(step, question.row, question.text, reply))
        self._note(question, person.name, now.activity, reply, state)

    def _note(
        self,
        question: PlannedNote,
        person: str,
        activity: str,
        reply: Reply | None,
        state: AttitudeState | None,
    ) -> None:
        """Record a person's answer for metrics."""
        state = state or AttitudeState(self._clock.start, 0.0, trust=0.0)
        robot = self.actors[question.row]
        request = self.queues[question.row].find(question.text)
        is_last = request is not None and request.is_last_stage
        value = request.value_at(robot.clock.time(question.step)) if request and is_last else 0.0
        self.log.append(
            AnswerRecord(
                step=question.step,
                robot=robot.name,
                text=question.text,
                addressed=person,
                activity=activity,
                outcome="" if reply is None else str(reply.outcome),
                delay_s=0.0 if reply is None else reply.delay.total_seconds(),
                value=value,
                woke=reply is not None and reply.woke,
                willingness=0.0 if reply is None else reply.willingness,
                novelty=state.novelty,
                burden=state.burden,
                annoyance=state.annoyance,
                trust=state.trust,
            )
        )

    def _addressed(self, row: int, meant: str, block: PoseBlock) -> int | None:
        """Return the user nearest to a robot, or the one meant at equal distance; None: nobody."""
        x, y = _point(row, block)
        reach = round(EARSHOT_M * self.actors[row].home.lattice.units_per_m)
        near = []
        for user in range(self.users):
            user_x, user_y = _point(user, block)
            squared = (user_x - x) ** 2 + (user_y - y) ** 2
            if not block.away[user, 0] and squared <= reach**2:
                near.append((squared, self.actors[user].name != meant, user))
        return min(near)[-1] if near else None

    def _circumstances(
        self, user: int, question: PlannedNote, interaction: Interaction, block: PoseBlock
    ) -> Circumstances:
        person = self.actors[user]
        row = question.row
        home = person.home
        x, y = _point(user, block)
        robot_x, robot_y = _point(row, block)
        dx = robot_x - x
        dy = robot_y - y
        turn = (heading_of(dx, dy) - int(block.heading[user, 0])) % TURN
        room = self._room(user, block)
        rooms = [self._room(other, block) for other in range(self.users)]
        return Circumstances(
            time=person.clock.time(question.step),
            name=question.text.rpartition(" ")[0],
            interaction=interaction,
            activity=self._activity_at(user, question.step),
            room="" if room is None else home.rooms[room].type,
            company=0 if room is None else rooms.count(room) - 1,
            is_moving=bool((block.x[user, 1], block.y[user, 1]) != (x, y)),
            is_lying=bool(block.posture[user, 0] == LYING),
            distance=math.sqrt(dx * dx + dy * dy) / home.lattice.units_per_m,
            in_sight=line_of_sight(home.walls, x, y, robot_x, robot_y),
            from_behind=min(turn, TURN - turn) > FRONT,
        )

    def _room(self, row: int, block: PoseBlock) -> int | None:
        """Return the index of the room that a body is in at the start of a block."""
        if block.away[row, 0]:
            return None
        room = self.actors[row].home.plan.room_of_point(*_point(row, block))
        return None if room is None else room.index

    def _activity_at(self, row: int, step: int) -> str:
        """Return the activity of a user at a step of the present plan; empty if it is unknown."""
        actor = self.actors[row]
        time_us = step * actor.clock.step_us
        for note in reversed(actor.plan.notes):
            if note.event == EventKind.ACTIVITY and note.time_us <= time_us:
                return note.detail
        return self._activity.get(row, "")

    def _give(self, pending: PendingReply, step: int, bodies: Bodies) -> list[Event]:
        """Give an answer: tell the robot, and let it obey."""
        row = pending.robot
        text = pending.text
        reply = pending.reply
        queue = self.queues[row]
        time = self.actors[row].clock.time(step)
        if (request := queue.find(text)) is not None:
            if reply.outcome == Outcome.ACCEPTED:
                self._accepted[row] = request, step
            queue.settle(request, reply.outcome, time, time + reply.later)
        self._tell(row, str(reply.outcome), text)
        name, _, person = text.rpartition(" ")
        user = self._row_of(person)
        events = self._obey(row, user, reply.outcome, text, step, bodies)
        asked = queue.interactions.get(name)
        if reply.outcome != Outcome.ACCEPTED or asked is None or asked.do != "ask":
            return events
        people = self.actors[: self.users]
        about = next((user.row for user in people if user.name == asked.about), None)
        if about is None:
            return events
        where = f"{asked.about} {self._whereabouts(about, user, bodies.block(step, step + 1))}"
        return [*events, Event(step, self.actors[row].name, EventKind.TOLD, where)]

    def _whereabouts(self, about: int, user: int, block: PoseBlock) -> str:
        """Return the answer about a person's whereabouts: away, the common room, or home."""
        if block.away[about, 0]:
            return "away"
        room = self._room(about, block)
        if room is None or room != self._room(user, block):
            return "home"
        return self.actors[about].home.rooms[room].name

    def _obey(
        self, row: int, user: int, outcome: Outcome, text: str, step: int, bodies: Bodies
    ) -> list[Event]:
        """Let a robot obey a person's answer at a step; return the events."""
        robot = self.actors[row]
        person = self.actors[user]
        answers = self.answers[user]
        events = []
        room = self._room(row, bodies.block(step, step + 1))
        lasts = {Outcome.SENT_AWAY: answers.away_for, Outcome.BANNED: answers.bans_for}.get(outcome)
        if lasts is not None and room is not None:
            until = step + self._steps_in(lasts)
            robot.keep_out(room, step + 1, until, text)
            self._bans.append(RoomBan(until, row, room))
            text = f"{text} {robot.home.rooms[room].name}"
        if outcome == Outcome.SWITCHED_OFF:
            for_good = answers.has_enough(self.attitudes[user, row])
            lasts = None if for_good else answers.off_for
            self._switch_off(robot, lasts, step + 1, f"users.{person.name}")
            if for_good:
                events.append(Event(step, robot.name, EventKind.GIVEN_UP, person.name))
        return [Event(step, robot.name, str(outcome), text), *events]

    def _switch_off(
        self, robot: DecidingActor, lasts: timedelta | None, step: int, by: str
    ) -> None:
        """Switch a robot off from a step on; None: for good."""
        from fleet2d.interventions.robots import SetPower  # few robots are switched off

        off = SetPower(entity=robot.name, state="off", duration=lasts)
        self._interventions.follow(off, step, by)

    def break_off(self, row: int, step: int) -> list[Event]:
        """Break off a robot's conversation, as it goes off at a step; return the event, if any.

        Nobody hears the answer; a request that was accepted but not carried out is reopened.
        """
        robot = self.actors[row]
        note = _broken_note(robot, step)
        self._replies = [reply for reply in self._replies if reply.robot != row]
        self._questions = [question for question in self._questions if question.row != row]
        accepted, since = self._accepted.pop(row, (None, -1))
        events = []
        if note is not None:
            time = self._clock.time(step)
            person = note.detail.rpartition(" ")[2]
            user = self._row_of(person)
            state = self.attitudes[user, row]
            self.answers[user].months.pass_time(state, time)
            self.answers[user].months.let_down(state)
            since_us = since * self._clock.step_us
            is_answered = note.event != EventKind.ASKS or since_us > note.time_us
            if accepted is not None and is_answered:
                self.queues[row].reopen(accepted, time)
            events.append(Event(step, robot.name, EventKind.BROKEN_OFF, note.detail))
        self._look_ahead()
        return events

    def _row_of(self, name: str) -> int:
        return next(actor.row for actor in self.actors if actor.name == name)

    def _end_bans(self, step: int) -> list[Event]:
        """End the bans of rooms that are over at a step."""
        ended = [ban for ban in self._bans if ban.until <= step]
        self._bans = [ban for ban in self._bans if ban.until > step]
        events = []
        for until, row, room in ended:
            robot = self.actors[row]
            if robot.bans.get(room, until) <= until:
                name = robot.home.rooms[room].name
                events.append(Event(step, robot.name, EventKind.ALLOWED, name))
        return events

    def _day_begin(self, day: int) -> int:
        """Return the step at which a day of the run begins."""
        return self._step_of(midnight_of(self._clock.start) + day * DAY)

    def _start(self, step: int, bodies: Bodies) -> list[Event]:
        """Let people start contacts with robots."""
        while self._initiators and self._day_begin(self._begun_days) <= step:
            midnight = midnight_of(self._clock.start) + self._begun_days * DAY
            for user, row in self._initiators:
                person = self.actors[user]
                robot = self.actors[row]
                key = person.stream(f"initiative {robot.name}")
                draws = Draws(key, self._begun_days)
                for start in self.answers[user].initiative.starts(draws):
                    at = self._step_of(midnight + start.day_share * DAY)
                    if at > step:
                        self._starts.append(DueStart(at, user, row, start.kind))
            self._begun_days += 1
            self._starts.sort()
        due = [start for start in self._starts if start.step <= step]
        self._starts = self._starts[len(due) :]
        events: list[Event] = []
        for due_start in due:
            events += self._turn_to(due_start, step, bodies)
        return events

    def _turn_to(self, start: DueStart, step: int, bodies: Bodies) -> list[Event]:
        """Let a person call a robot, ask it something, or complain; return the events."""
        _, user, row, kind = start
        person = self.actors[user]
        robot = self.actors[row]
        block = bodies.block(step, step + 1)
        if robot.is_off or block.away[user, 0] or self._activity_at(user, step) in ASLEEP:
            return []
        lattice = robot.home.lattice
        x, y = _point(user, block)
        if kind == "call":
            near = robot.space.nearest(x, y, robot.part) or robot.state.position
            robot.receive(Command("come", place=lattice.xy_of(*near)), step + 1)
            return [Event(step, robot.name, EventKind.CALLED, f"come {person.name}")]
        if kind == "question":
            reach = EARSHOT_M * lattice.units_per_m
            robot_x, robot_y = _point(row, block)
            if (robot_x - x) ** 2 + (robot_y - y) ** 2 > reach**2:
                return []
            asked = SightEvent(EventKind.QUESTION, person.name, *lattice.xy_of(x, y))
            self._last.append((row, asked))
            return [Event(step, robot.name, EventKind.QUESTION, person.name)]
        room = self._room(user, block)
        state = self.attitudes[user, row]
        if room is None or room != self._room(row, block):
            return []
        self.answers[user].months.pass_time(state, self._clock.time(step))
        outcome = self.answers[user].complaint(state, person.home.rooms[room].type)
        if outcome is None:
            return []
        self.answers[user].months.let_down(state, outcome)
        return self._obey(row, user, outcome, person.name, step, bodies)


def _point(row: int, block: PoseBlock) -> LatticePoint:
    """Return the position of a body at the start of a block [lattice units]."""
    return int(block.x[row, 0]), int(block.y[row, 0])


def _broken_note(robot: DecidingActor, step: int) -> Note | None:
    """Return the note about a robot's unfinished business with a person at a step.

    This is a question without an answer yet, or an accepted request that isn't carried out.
    """
    now_us = step * robot.clock.step_us
    if robot.plan.is_over(step):
        return None
    for note in robot.plan.notes:
        is_asked = note.event == EventKind.ASKS and note.time_us < now_us
        is_undone = note.event in (EventKind.COLLECTS, EventKind.DELIVERED)
        if is_asked or (is_undone and note.time_us >= now_us):
            return note
    return None


def _check_answers_calls(person: DecidingActor, robot: DecidingActor, answers: Answers) -> None:
    """Refuse calls of a robot that can't come.

    Raises:
        ScenarioError: No behavior of the robot does.
    """
    can_come = any(behavior.takes(Command("come")) for behavior in robot.behaviors)
    if answers.initiative.calls and not can_come:
        raise ScenarioError(
            f"{person.path}.answers.initiative.calls: none of the behaviors of {robot.name} answers"
            " calls: give it one, like behaviors: [{type: come}, …]"
        )
