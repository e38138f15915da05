"""How people answer: each part alone changes the stage it should, and nothing else."""

from datetime import datetime, timedelta

import pytest

from fleet2d.interactions.answers import PARTS, AnswerPart, Answers, Circumstances
from fleet2d.interactions.attitude import AttitudeState
from fleet2d.interactions.interaction import Interaction, Outcome

MORNING = datetime(2026, 1, 5, 8)
PILL = Interaction(do="remind", to="ana", at=("08:00",), worth=2)
IDLE = Interaction(do="offer", to="ana", every="1 h", worth=0)
NEAR = Circumstances(
    time=MORNING,
    name="pill",
    interaction=PILL,
    activity="rest",
    room="living_room",
    company=0,
    is_moving=False,
    is_lying=False,
    distance=1.0,
    in_sight=True,
    from_behind=False,
)
STAGES = ("notice", "available", "accept")
OFTEN = AttitudeState(MORNING, burden=9.0)
ANNOYED, NEW = AttitudeState(MORNING, annoyance=2.0), AttitudeState(MORNING, novelty=1.0)
HABIT = AttitudeState(MORNING, novelty=0.0, habits={"pill": (0.8, 8 * 3600.0)})
TRUSTING = AttitudeState(MORNING, novelty=0.0, trust=0.9)
JUST_NOW = AttitudeState(MORNING, novelty=0.0, last=MORNING - timedelta(minutes=5))
USED = AttitudeState(MORNING, novelty=0.0)


def chances(now=NEAR, state=USED, **parts):
    answers = Answers(**parts)
    return [answers.chance(stage, now, state) for stage in STAGES]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("circumstances", "state", "stage", "sign"),
    [
        ({"activity": "sleep"}, USED, "notice", -1),
        ({"distance": 6.0}, USED, "notice", -1),
        ({"in_sight": False}, USED, "notice", -1),
        ({"activity": "phone_call"}, USED, "available", -1),
        ({"activity": "breakfast"}, USED, "available", 1),
        ({"company": 2}, USED, "available", -1),
        ({"is_moving": True}, USED, "available", -1),
        ({"interaction": PILL.model_copy(update={"worth": 9.0})}, USED, "accept", 1),
        ({"interaction": PILL.model_copy(update={"do": "offer"})}, USED, "accept", -1),
        ({"distance": 0.3}, USED, "accept", -1),
        ({"from_behind": True}, USED, "accept", -1),
        ({"is_moving": True, "distance": 0.8}, USED, "accept", -1),
        ({}, JUST_NOW, "accept", -1),
        ({}, OFTEN, "accept", -1),
        ({}, NEW, "accept", 1),
        ({}, HABIT, "accept", 1),
        ({}, TRUSTING, "accept", 1),
    ],
)
def test_each_circumstance_changes_its_stage(circumstances, state, stage, sign):
    usual = USED if state is not OFTEN else AttitudeState(MORNING)
    before = chances(state=usual)
    after = chances(NEAR._replace(**circumstances), state)
    number = STAGES.index(stage)

    assert sign * (after[number] - before[number]) > 0.02


def test_annoyance_makes_people_refuse():
    offered = NEAR._replace(interaction=IDLE)
    assert chances(offered, ANNOYED)[2] < chances(offered, AttitudeState(MORNING))[2] - 0.05


def test_a_sleeper_is_never_available():
    assert chances(NEAR._replace(activity="sleep"))[1] < 0.001


def test_a_text_is_not_noticed_by_those_who_look_elsewhere():
    shown = NEAR._replace(interaction=PILL.model_copy(update={"manner": "shown"}))
    assert chances(shown)[0] > 0.9 > 0.4 > chances(shown._replace(from_behind=True))[0]


class Silent(AnswerPart):
    """Adds nothing, in place of any part."""

    def logit(self, now, state):
        return 0.0


@pytest.mark.parametrize("part", PARTS)
def test_each_part_can_be_replaced_by_one_class(part):
    now = NEAR._replace(activity="phone_call", company=1, is_moving=True, distance=0.3)
    busy = AttitudeState(MORNING, burden=9, annoyance=2, last=MORNING)

    assert chances(now, busy) != chances(now, busy, **{part: Silent()})


def answers_of(count, now, state, **parts):
    answers = Answers(**parts)
    replies = [answers.reply(now, state, 4, "users.ana", step) for step in range(count)]
    return ["" if reply is None else reply.outcome for reply in replies]


def test_outcomes_come_as_often_as_their_chances_say():
    notice, available, accept = chances()
    outcomes = answers_of(4000, NEAR, USED)

    assert outcomes.count("") / 4000 == pytest.approx(1 - notice, abs=0.015)
    accepted = outcomes.count(Outcome.ACCEPTED) / 4000
    assert accepted == pytest.approx(notice * available * accept, abs=0.03)
    deferred = outcomes.count(Outcome.DEFERRED)
    ignored = outcomes.count(Outcome.IGNORED)
    assert deferred / (deferred + ignored) == pytest.approx(0.3, abs=0.06)


@pytest.mark.parametrize(
    ("annoyance", "room", "outcome"),
    [
        (4.0, "living_room", Outcome.SENT_AWAY),
        (6.0, "living_room", Outcome.SENT_AWAY),
        (6.0, "bedroom", Outcome.BANNED),
        (9.0, "bedroom", Outcome.SWITCHED_OFF),
    ],
)
def test_a_bad_line_ends_in_consequences(annoyance, room, outcome):
    state = AttitudeState(MORNING, novelty=0.0, annoyance=annoyance)
    outcomes = set(answers_of(200, NEAR._replace(room=room, interaction=IDLE), state))

    assert outcomes <= {"", Outcome.ACCEPTED, outcome}
    assert outcome in outcomes


def test_annoyance_and_burden_hardly_count_for_what_is_urgent():
    fed_up = AttitudeState(MORNING, novelty=0.0, annoyance=6.0, burden=17.0, trust=0.2)
    medicine = NEAR._replace(interaction=PILL.model_copy(update={"worth": 5.0}))

    assert chances(medicine, fed_up)[2] > 0.5 > 0.1 > chances(NEAR, fed_up)[2]
    assert Outcome.SENT_AWAY not in answers_of(200, medicine, fed_up)
    assert Outcome.SENT_AWAY in answers_of(200, NEAR._replace(interaction=IDLE), fed_up)


@pytest.mark.parametrize(("below", "outcome"), [(0.1, "switched_off"), (0.0, "sent_away")])
def test_who_trusts_it_no_more_switches_it_off_instead_of_sending_it_away(below, outcome):
    state = AttitudeState(MORNING, annoyance=3.5, trust=0.05)
    answers = Answers(gives_up_below=below)

    assert outcome == answers.complaint(state, "living_room")
    assert (below > 0) == answers.has_enough(state)
    assert answers.complaint(AttitudeState(MORNING, annoyance=2.5, trust=0), "bedroom") is None


def test_the_same_draw_answers_at_the_same_step_whatever_else_differs():
    better = answers_of(300, NEAR._replace(activity="breakfast"), USED)
    worse = answers_of(300, NEAR._replace(activity="work_at_home"), USED)

    lost = [b for b, w in zip(better, worse, strict=True) if w == Outcome.ACCEPTED != b]
    assert [] == lost  # whoever accepts at work would accept at breakfast
