"""The planner: no day that it draws breaks a constraint, and they spread as they are told to."""

import statistics
from datetime import date
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from tests.reference.planner import RoomTimes, SlowPlanner
from tests.routines.days import DAY_S, MONDAY, violations
from tests.thorough import THOROUGH, examples

from fleet2d.kernels import RoomUse
from fleet2d.routines.interruptions import without_interruptions
from fleet2d.routines.life import Life
from fleet2d.routines.persona import Persona, bundled_names, bundled_persona

HOUR = 3600


def life(persona, seed=4, path="users.ana"):
    return Life(persona, seed, path)


def of(do, **day):
    """A persona with one template for every day."""
    return Persona.model_validate({"days": {"any_day": {"on": "daily", "do": do, **day}}})


def tasks(day):
    return [episode.task for episode in day if episode.task]


@pytest.mark.parametrize("name", bundled_names())
def test_no_day_of_thousands_breaks_a_constraint(name):
    persona = bundled_persona(name)
    for seed in range(5 if THOROUGH else 1):
        lived = life(persona, seed)
        days = [lived.day(MONDAY + i) for i in range(341)]  # 6 personas x 340, or 10,200 days
        for i, (day, after) in enumerate(pairwise(days)):
            assert [] == violations(persona, MONDAY + i, day, after)


def test_wake_meal_and_bed_times_spread_as_stated():
    persona = bundled_persona("works_outside")
    lived = life(persona)
    days = [
        without_interruptions(lived.day(MONDAY + 7 * w + i)) for w in range(300) for i in range(5)
    ]
    template = persona.days["weekdays"]
    wakes = [day[0].begin for day in days]
    cooking = [d.begin for day in days for d in day if d.task == "cook"]
    beds = [day[-1].begin for day in days]
    for times, timing in (
        (wakes, template.wake),
        (cooking, template.do["cook"]),
        (beds, template.sleep),
    ):
        spread = timing.spread.total_seconds()
        assert timing.at.total_seconds() == pytest.approx(statistics.mean(times), abs=0.5 * spread)
        assert spread == pytest.approx(statistics.pstdev(times), rel=0.25)


def test_a_day_does_not_depend_on_which_were_asked_for_before():
    persona = bundled_persona("retired")
    straight = life(persona)
    days = [straight.day(MONDAY + i) for i in range(30)]
    assert days[17] == life(persona).day(MONDAY + 17)


def test_probability_is_the_share_of_days():
    persona = of({"shopping": {"between": ["10:00", "18:00"], "probability": 0.3}})
    lived = life(persona)
    done = sum("shopping" in tasks(lived.day(MONDAY + i)) for i in range(3000))
    assert 0.3 == pytest.approx(done / 3000, abs=0.03)


def test_what_follows_comes_at_once_and_only_after_what_it_follows():
    persona = of(
        {
            "dishes": {"after": ["dinner"]},
            "dinner": {"at": "18:00", "probability": 0.5},
            "shopping": {"between": ["17:00", "20:00"]},
        }
    )
    lived = life(persona)
    for i in range(200):
        names = tasks(without_interruptions(lived.day(MONDAY + i)))
        assert ("dinner" in names) == ("dishes" in names)
        if "dinner" in names:
            assert names.index("dishes") == names.index("dinner") + 1


def test_an_appointment_is_kept_to_the_second_however_full_the_day():
    errand = {"activity": "errand", "between": ["09:00", "16:00"], "probability": 0.9}
    crowd = {f"errand_{i}": errand for i in range(12)}
    persona = of({**crowd, "doctor": {"activity": "errand", "at": "11:20", "fixed": True}})
    lived = life(persona)
    for i in range(300):
        day = without_interruptions(lived.day(MONDAY + i))
        assert [11 * HOUR + 20 * 60] == [d.begin for d in day if d.task == "doctor"]
        assert [] == violations(persona, MONDAY + i, day, lived.day(MONDAY + i + 1))


def test_the_least_frequent_is_left_out_when_a_day_is_too_full():
    long = {"takes": {"law": "fixed", "mean": "6 h"}, "between": ["07:00", "22:00"]}
    chances = {"work": 1.0, "study": 0.95, "hobby": 0.6}
    do = {name: {**long, "probability": chance} for name, chance in chances.items()}
    lived = life(of(do, wake="07:00", sleep={"at": "23:00", "spread": 0}))
    drawn = [tasks(lived.day(MONDAY + i)) for i in range(500)]
    assert all("work" in names for names in drawn)
    assert not any({"study", "hobby"} <= set(names) for names in drawn)
    assert sum("study" in names for names in drawn) == pytest.approx(0.95 * 500, abs=25)


def test_dates_have_their_own_day():
    persona = Persona.model_validate(
        {
            "days": {
                "usual": {"on": "daily", "do": {"work": {"at": "08:00"}}},
                "feast": {"dates": [date(2026, 1, 6), [date(2026, 1, 8), date(2026, 1, 9)]]},
            }
        }
    )
    lived = life(persona)
    assert [True, False, True, False, False, True] == [
        "work" in tasks(lived.day(MONDAY + i)) for i in range(6)
    ]


def test_waiting_is_filled_with_what_the_hour_allows():
    persona = Persona.model_validate(
        {
            "leisure": {"tv": {"between": ["18:00", "21:00"]}, "read": 1},
            "days": {"any_day": {"on": "daily"}},
        }
    )
    lived = life(persona)
    for i in range(50):
        for episode in without_interruptions(lived.day(MONDAY + i)):
            if episode.activity == "tv":
                assert 18 * HOUR <= episode.begin % DAY_S <= 21 * HOUR


@pytest.mark.parametrize(
    ("do", "words"),
    [
        ({"work": {"at": "08:00", "takes": {"law": "fixed", "mean": "30 h"}}}, ["work", "30 h"]),
        (
            {
                "doctor": {"activity": "errand", "at": "10:00", "fixed": True, "takes": "1 h"},
                "school": {"at": "10:15", "fixed": True},
            },
            ["school", "10:15", "doctor", "10:00", "overlap"],
        ),
        ({"jog": {"at": "08:00"}}, ["jog", "no activity"]),
        ({"cook": {"at": "12:00", "after": ["shoping"]}, "shopping": {"at": "10:00"}}, ["shoping", "did you mean 'shopping'"]),
        ({"cook": {"after": ["lunch"]}, "lunch": {"after": ["cook"]}}, ["wait for each other", "cook", "lunch"]),
        ({"cook": {"at": "12:00", "between": ["13:00", "14:00"]}}, ["12:00", "13:00", "14:00"]),
        ({"cook": {"fixed": True}}, ["at"]),
        ({"cook": {"at": "12:00", "before_bed": True}}, ["exactly one of"]),
        (
            {"work": {"at": "08:00", "takes": {"law": "fixed", "mean": "12 h"}}, "school": {"at": "09:00"}},
            ["work", "12 h", "'school' has to begin by 09:37"],
        ),
        ({"cook": {"at": "12:00", "takes": {"at_least": "1 h", "at_most": "30 min"}}}, ["1 h", "30 min"]),
        ({"cook": {"at": "12:00", "takes": {"law": "measured", "quantiles": ["1 h"]}}}, ["quantiles"]),
    ],
)  # fmt: skip
def test_a_template_that_is_impossible_is_refused_in_plain_words(do, words):
    with pytest.raises(ValidationError) as caught:
        of(do)
    for word in words:
        assert word in str(caught.value)


def test_a_night_that_is_too_short_is_refused():
    with pytest.raises(ValidationError, match="too short a night"):
        of({}, wake="05:00", sleep={"at": "02:00", "at_least": "6 h"})


def test_days_of_the_week_without_a_template_are_named():
    with pytest.raises(ValidationError, match="saturday, sunday"):
        Persona.model_validate({"days": {"work": {"on": "weekdays"}}})


@st.composite
def templates(draw):
    """Templates of any kind, possible and not."""
    names = ["cook", "read", "work", "errand", "hobby", "study"][: draw(st.integers(1, 6))]
    do = {}
    for name in names:
        first = draw(st.integers(0, 23))
        task = {"probability": draw(st.sampled_from([0.3, 0.7, 1.0]))}
        kind = draw(st.sampled_from(["at", "between", "follows", "waking", "bed"]))
        if kind == "at":
            task |= {"at": f"{first:02}:30", "spread": draw(st.integers(0, 5400))}
        elif kind == "between":
            task["between"] = [f"{first:02}:00", f"{(first + draw(st.integers(1, 8))) % 24:02}:00"]
        elif kind == "waking":
            task["on_waking"] = True
        elif kind == "bed":
            task["before_bed"] = True
        if do and (kind == "follows" or draw(st.booleans())):
            task["after"] = [draw(st.sampled_from(sorted(do)))]
        low = draw(st.integers(1, 120))
        task["takes"] = {
            "law": draw(st.sampled_from(["lognormal", "gamma", "normal"])),
            "mean": f"{low + 20} min",
            "at_least": f"{low} min",
            "at_most": f"{low + draw(st.integers(1, 200))} min",
        }
        do[name] = task
    return do


@settings(max_examples=examples(60))
@given(do=templates(), seed=st.integers(0, 1000))
def test_any_template_is_either_refused_or_kept(do, seed):
    try:
        persona = of(do)
    except ValidationError:
        return
    lived = life(persona, seed)
    for i in range(20):
        day, after = lived.day(MONDAY + i), lived.day(MONDAY + i + 1)
        assert [] == violations(persona, MONDAY + i, day, after)
        same_in_python(lived, MONDAY + i)


def same_in_python(lived, ordinal):
    """Check that the core plans the same day as its twin, also if others use private rooms."""
    plan, span = lived.template(ordinal), (lived.wake(ordinal), lived.wake(ordinal + 1) + DAY_S)
    twin, use, times = SlowPlanner(*plan.core.__getstate__()), RoomUse(), RoomTimes()
    for room, begin in ((3, 25_000), (3, 26_000), (5, 25_500), (3, 60_000), (5, 59_000)):
        for each in (use, times):
            each.add(room, begin + 60 * (ordinal % 60), begin + 6000)
    rooms = [((3, 5), (), (5,))[i % 3] for i in range(len(plan.jobs))]
    for shared in ((None, None), (use, times)):
        core, python = lived.draws(ordinal), lived.draws(ordinal)
        slow = twin.plan(python, *span, shared[1], rooms)
        assert slow == plan.core.plan(core, *span, shared[0], rooms)
        assert python.below(1 << 30) == core.below(1 << 30)
    chosen = [job.needed for job in plan.jobs]
    for by_deadline in (False, True):
        core, python = lived.draws(ordinal), lived.draws(ordinal)
        slow = twin.draw_order(python, chosen, *span, by_deadline)
        assert slow == plan.core.draw_order(core, chosen, *span, by_deadline)


@pytest.mark.parametrize("name", bundled_names())
def test_the_core_plans_days_as_python_does(name):
    lived = life(bundled_persona(name))
    for ordinal in range(MONDAY, MONDAY + 60):
        same_in_python(lived, ordinal)


def test_pastimes_that_always_take_no_time_are_refused():
    """Two of them took turns forever, and the run never began."""
    takes = {"takes": ["0 s", "1 s"]}
    with pytest.raises(ValidationError, match="'read' may take 0 s"):
        Persona.model_validate(
            {
                "activities": {"read": takes, "tv": takes},
                "leisure": {"read": 1, "tv": 1},
                "days": {"any_day": {"on": "daily"}},
            }
        )
