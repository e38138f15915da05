"""The loop of a run: from span to span, in the order that the design fixes.

In each step: floor plan, users, robots, objects, algorithms, metrics. Between two steps at which
somebody must decide, nothing but arithmetic happens, so the loop takes the whole *span* between
them at once. What a span is never shows in a result: every draw is addressed by step, and every
plan by time.
"""

from fleet2d.algorithms.log import SENSOR, Log, Piece
from fleet2d.blame import blame
from fleet2d.clock import Clock
from fleet2d.engine.buckets import look_together
from fleet2d.engine.world import World
from fleet2d.entities.behavior import SightEvent, Situation
from fleet2d.floorplan.change import HomeChanges


class Loop:
    """Takes a world from span to span.

    Attributes:
        step: The next step to simulate; 0 at first.
    """

    def __init__(self, world: World, clock: Clock, max_span: int | None) -> None:
        """Begin before the first step.

        Args:
            world: What takes part.
            clock: Of the run.
            max_span: The most steps of a span; None for as many as there is room for.
        """
        self._world, self._clock = world, clock
        self._actors = world.actors
        self._pending: dict[int, list[SightEvent]] = {}  # events that interrupted a robot's plan
        self._max_span = min(max_span or world.block.capacity, world.block.capacity)
        self.step = 0

    def span(self, limit: int) -> None:
        """Simulate one span: up to the next decision, and not beyond step `limit`."""
        world, block, first = self._world, self._world.block, self.step
        self._change(first)
        self._decide(first)
        count = self._span_end(limit) - first
        self._move(first, count)
        count = world.clearance.limit(block, first, count)
        count = world.encounters.limit(block, first, count)
        if SENSOR in world.learners.awaited:
            with blame("objects", first):
                count = world.sensors.limit(block, first, count, world.home)
        if world.eyes or world.gazes:
            count = look_together([*world.eyes, *world.gazes], block, first, count)
        observations = world.recorder.span(block, first, count, world.eyes, world.gazes)
        self._sense(first, count)
        world.layers.span(block, first, count)
        for row, actor in enumerate(self._actors):
            actor.state = block.state(row, count)
        self._interrupt(first + count - 1)
        for row, user, event in world.encounters.take(block, first, count):
            self._pending.setdefault(row, []).append(event)
            user.ask_at = first + count
        self.step = first + count
        if world.log:
            if observations is not None:
                world.log.observe(observations)
            world.log.sights += [
                eye.sights(self.step) for eye in [*world.eyes, *world.gazes] if eye.happened
            ]
            self._learn(world.log)
        world.layers.keep(self.step)

    def count_looks(self, log: Log) -> None:
        """Keep for metrics what the cameras have counted up to the present step."""
        log.count_looks(self.step, [eye.counts for eye in self._world.eyes])
        self._world.layers.expose(self.step, log)

    def _move(self, first: int, count: int) -> None:
        """Let everybody follow its plan through the span."""
        log, block = self._world.log, self._world.block
        for row, actor in enumerate(self._actors):
            if log:
                log.pieces[row].append(Piece(first, actor.state, actor.motion))
            actor.motion.trace(first, actor.state, block.row(row, count + 1))
            block.take_postures(row, first, count, actor.plan, self._clock.step_us)

    def _sense(self, first: int, count: int) -> None:
        """Let the sensors read the span."""
        world = self._world
        if world.sensors.names:
            with blame("objects", first):
                rows = world.sensors.span(world.block, first, count, world.home, self._actors)
            world.recorder.sensed(rows)
            if world.log:
                world.log.readings += rows

    def _learn(self, log: Log) -> None:
        """Update the algorithms and metrics that are due."""
        learners = self._world.learners
        awaited = learners.awaited
        happened = log.happened(self.step - 1) if awaited else []
        if learners.next_due() == self.step or any(event.event in awaited for event in happened):
            self.count_looks(log)
            learners.update(self.step, log, happened)
            self._take_up_changes()
            log.forget(learners.earliest_needed())

    def _change(self, step: int) -> None:
        """Let the home change as it is due: the floor plan comes first in a step."""
        due = self._world.changes.next_due()
        if due is not None and due <= step:
            with blame("changes", step):
                self._world.recorder.changed(self._world.changes.make(step, self._actors))

    def _decide(self, step: int) -> None:
        """Ask everybody whose plan is over, or who would drive at somebody: users, then robots."""
        world = self._world
        for row, actor in enumerate(self._actors):
            due = actor.ask_at is not None and actor.ask_at <= step
            whom = None
            if due:
                events = tuple(self._pending.pop(row, ()))
                now = Situation(actor, step, events, world.learners.readable)
                due = not actor.goes_on(now)
            if due:
                self._end_plan(row, step)
                actor.decide(now)
            if world.clearance.robots:
                whom = world.clearance.in_way(row, step)
            if whom is not None:
                if not due:
                    self._end_plan(row, step)
                now = Situation(actor, step, (), world.learners.readable)
                actor.give_way(now, whom.name, world.clearance.people(actor))
            if due or whom is not None:
                world.changes.expect(row, actor)
                world.recorder.after_plan(row, step)

    def _end_plan(self, row: int, step: int) -> None:
        """Tell of a plan what happened up to the step at which it is replaced."""
        actor = self._actors[row]
        self._world.recorder.before_plan(row, step)
        if self._world.log:
            self._world.log.tell(actor, step)
        self._world.encounters.before_plan(row, actor, step)

    def _take_up_changes(self) -> None:
        """Let what algorithms just put out to change the home happen at the next step."""
        for name, output in self._world.learners.fresh.items():
            if isinstance(output, HomeChanges):
                for change in output.changes:
                    self._world.changes.ask(change, self.step, f"algorithms.{name}")

    def _span_end(self, limit: int) -> int:
        """Return the step before which the present span ends at the latest."""
        end = min(limit, self.step + self._max_span)
        for actor in self._actors:
            if actor.ask_at is not None and actor.ask_at < end:
                end = actor.ask_at
        dues = (
            self._world.learners.next_due(),
            self._world.changes.next_due(),
            self._world.layers.next_due(self.step),
        )
        for due in dues:
            if due is not None:
                end = min(end, max(due, self.step + 1))
        if self._world.log and self._world.learners.awaited:
            noted = self._world.log.next_note(self.step, self._world.learners.awaited)
            end = end if noted is None else min(end, noted + 1)
        return end

    def _interrupt(self, step: int) -> None:
        """End the plans of bodies that a sight of the span's last step interrupts."""
        lattice = self._world.home.plan.lattice
        for eye in [*self._world.gazes, *self._world.eyes]:
            eye.remember()
            stops = eye.stops
            events = eye.events
            for i in range(eye.happened):
                if events.step[i] == step and stops[events.kind[i]]:
                    who = int(events.user[i])
                    x, y = lattice.to_metres(eye.perceived[who]).tolist()
                    event = SightEvent(eye.event_names[events.kind[i]], eye.name_of(who), x, y)
                    self._pending.setdefault(eye.row, []).append(event)
                    eye.owner.ask_at = step + 1
