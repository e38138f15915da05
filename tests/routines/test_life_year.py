"""Year: illness, vacations, holidays, seasons and changes of routine, drawn for each year anew."""

from datetime import date
from itertools import pairwise

import pytest
from pydantic import ValidationError
from tests.routines.days import MONDAY
from tests.scenes import run, scenario

from fleet2d.routines.household import AWAY, Household
from fleet2d.routines.life import FOREVER, Life, Lives, Year
from fleet2d.routines.persona import Persona, bundled_days, read_persona

HOUR = 3600
NEW_YEAR = date(2026, 1, 1).toordinal()
FLU = {"every": "60 d", "lasts": {"mean": "4 d", "std": "2 d"}, "days": "ill"}


def persona(extends="works_outside", **year):
    return Persona.model_validate(read_persona({"extends": extends, "year": year}))


def life(seed=4, **year):
    return Life(persona(**year), seed, "users.ana")


def spans(event, years=1, seed=4):
    """When an event is in the years from 2026 on."""
    year = Year(persona(event=event).year, seed, "users.ana")
    last = date(2026 + years, 1, 1).toordinal()
    found = {span for day in range(NEW_YEAR, last) for span in year.on(day).values()}
    return sorted(found)


def day(ordinal):
    return date.fromordinal(ordinal).isoformat()


def test_an_illness_comes_as_often_and_lasts_as_long_as_it_says():
    found = spans(FLU, years=60)
    lengths = [last - first + 1 for first, last in found]
    assert 60 * 365 / (60 + 4) == pytest.approx(len(found), rel=0.1)
    assert sum(lengths) / len(lengths) == pytest.approx(4, rel=0.1)
    assert min(lengths) == 1
    assert spans(FLU, years=2) != spans(FLU, years=2, seed=5)


def test_a_vacation_begins_within_its_part_of_each_year():
    found = spans({"yearly": ["07-10", "08-20"], "lasts": "14 d", "away": True}, years=20)
    assert len(found) == 20
    assert all("07-10" <= day(first)[5:] <= "08-20" for first, _ in found)
    assert len({day(first)[5:] for first, _ in found}) > 10


HEAT = {"every": "20 d", "season": ["06-01", "08-31"], "lasts": "4 d", "days": "hot"}


def test_heat_comes_by_chance_and_begins_in_its_season_only():
    found = spans(HEAT, years=30)
    anytime = spans({name: value for name, value in HEAT.items() if name != "season"}, years=30)

    assert all("06-01" <= day(first)[5:] <= "08-31" for first, _ in found)
    assert set(found) == {s for s in anytime if "06-01" <= day(s[0])[5:] <= "08-31"}
    assert 30 * 92 / 24 == pytest.approx(len(found), rel=0.15)


def test_a_season_of_chance_may_last_past_new_year():
    found = spans({**HEAT, "season": ["12-01", "01-31"]}, years=10)

    assert {"12", "01"} == {day(first)[5:7] for first, _ in found}


def test_days_of_heat_have_a_siesta_and_an_evening_outside():
    days = {"season": ["06-01", "08-31"], "days": "hot"}
    june = date(2026, 6, 1).toordinal()
    lives = life(), life(heat=days)
    cool, hot = ([e.activity for d in range(june, june + 30) for e in own.day(d)] for own in lives)

    assert cool.count("sit_outside") == 0
    assert hot.count("nap") > 15
    assert hot.count("sit_outside") > 15
    assert hot.count("work") == 0


def test_a_season_may_last_past_new_year_and_end_on_a_leap_day():
    found = spans({"season": ["11-15", "02-29"], "days": "day_off"}, years=3)
    assert [(day(first), day(last)) for first, last in found] == [
        ("2025-11-15", "2026-02-28"),
        ("2026-11-15", "2027-02-28"),
        ("2027-11-15", "2028-02-29"),
        ("2028-11-15", "2029-02-28"),
    ]


def test_what_is_once_and_has_no_length_is_for_good():
    (span,) = spans({"once": ["2026-09-01", "2026-12-01"], "becomes": "retired"}, years=3)
    assert "2026-09-01" <= day(span[0]) <= "2026-12-01"
    assert span[1] == FOREVER


def test_a_public_holiday_is_one_of_its_country_and_is_stored_with_the_persona():
    pytest.importorskip("holidays")
    feasts = persona(feasts={"holidays": "DE-BY", "days": "day_off"})
    assert [day(first) for first, _ in spans(feasts.year["feasts"].model_dump())][:3] == [
        "2026-01-01",
        "2026-01-06",
        "2026-04-03",
    ]
    stored = feasts.model_dump(mode="json")["year"]["feasts"]
    assert len(stored["dates"]) > 500
    assert Persona.model_validate(feasts.model_dump(mode="json")) == feasts


def test_ill_people_stay_at_home_and_sleep_by_day():
    own = life(flu=FLU)
    ill = [d for d in range(MONDAY, MONDAY + 200) if own.template(d).name == "ill"]
    assert ill
    for ordinal in ill:
        activities = [episode.activity for episode in own.day(ordinal)]
        assert "work" not in activities
        assert "errand" not in activities
    assert any("nap" in [e.activity for e in own.day(d)] for d in ill)


def test_all_other_days_are_as_without_the_event():
    own, usual = life(flu=FLU), Life(persona(), 4, "users.ana")
    for ordinal in range(MONDAY, MONDAY + 100):
        about = {own.template(ordinal + i).name for i in range(2)}
        if "ill" not in about:
            assert own.day(ordinal) == usual.day(ordinal)


def test_days_do_not_depend_on_the_order_in_which_they_are_asked_for():
    year = {"flu": FLU, "leaves": {"yearly": ["02-01", "02-10"], "lasts": "7 d", "away": True}}
    straight, hopping = life(**year), life(**year)
    days = {ordinal: straight.day(ordinal) for ordinal in range(MONDAY, MONDAY + 60)}
    for ordinal in (MONDAY + 50, MONDAY + 2, MONDAY + 33, MONDAY + 32):
        assert hopping.day(ordinal) == days[ordinal]


def test_on_vacation_nobody_is_at_home_from_ten_on_the_first_day_to_six_on_the_last():
    own = life(leaves={"once": date(2026, 3, 2), "lasts": ["7 d", "7 d"], "away": True})
    first = date(2026, 3, 2).toordinal()
    away = [
        ((day - first) * 86_400 + episode.begin, (day - first) * 86_400 + episode.end)
        for day in range(first - 2, first + 9)
        for episode in own.day(day)
        if episode.activity == AWAY
    ]
    assert (10 * HOUR, (6 * 24 + 18) * HOUR) == (away[0][0], away[-1][1])
    assert all(end == begin for (_, end), (begin, _) in pairwise(away))


def test_who_retires_lives_the_days_of_the_retired_from_then_on():
    own = life(retires={"once": date(2026, 3, 2), "becomes": "retired"})
    retired = Life(persona("retired"), 4, "users.ana")
    first = date(2026, 3, 2).toordinal()
    assert own.template(first - 3).name == "weekdays"
    assert own.day(first + 10) == retired.day(first + 10)


def test_a_family_is_on_vacation_at_one_time():
    members = {"ana": "works_outside", "cleo": "child"}
    summer = {"yearly": ["07-10", "08-20"], "lasts": ["14 d", "14 d"], "away": True}
    household = Household.model_validate({"members": members, "year": {"summer": summer}})
    home = Lives(household, 4, date(2026, 7, 1).toordinal())
    away = {
        (name, ordinal)
        for ordinal in range(home.first, home.first + 80)
        for name, episodes in home.day(ordinal).items()
        if any(e.activity == AWAY for e in episodes)
    }
    ana, cleo = ({day for who, day in away if who == name} for name in members)
    assert ana == cleo
    assert len(ana) == 14


def test_a_guest_comes_by_chance_and_stays_for_some_hours():
    members = {"ana": "works_outside", "vera": "retired"}
    visits = {"vera": {"every": "4 d", "between": ["14:00", "16:00"], "takes": ["30 min", "2 h"]}}
    home = Lives(Household.model_validate({"members": members, "visits": visits}), 4, MONDAY - 1)
    days = [home.day(MONDAY + i)["vera"] for i in range(200)]
    stays = [sum(e.end - e.begin for e in day if e.activity != AWAY) for day in days]
    came = [stay for stay in stays if stay]
    assert len(came) == pytest.approx(50, abs=15)
    assert 1800 <= min(came) <= max(came) <= 7200


def test_a_year_in_a_home_runs_and_is_the_same_for_other_spans():
    year = {
        "flu": {"every": "10 d", "lasts": "2 d", "days": "ill"},
        "moves": {"once": "2026-01-07", "becomes": "student"},
    }
    users = {"ana": {"type": "routine", "persona": {"extends": "works_outside", "year": year}}}
    content = scenario("5 d", users=users)
    assert run(content).digest == run(content, "simulation.max_span=3600").digest


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ({"days": "ill"}, "exactly one of every, yearly, once, season, holidays"),
        ({"once": "2026-01-01", "season": ["01-01", "02-01"], "days": "ill"}, "exactly one"),
        ({"every": "9 d", "lasts": "1 d"}, "exactly one of days, away and becomes"),
        ({"every": "9 d", "days": "ill"}, "lasts: 5 d"),
        ({"every": "9 d", "lasts": "1 d", "days": "il"}, "did you mean 'ill'"),
        ({"season": ["01-01", "02-30"], "away": True}, "a month and a day like 07-15"),
        ({"season": ["01-01", "02-01"], "away": True, "lasts": "1 d"}, "leave out 'lasts'"),
        ({"once": ["2026-02-01", "2026-01-01"], "away": True}, "swap them"),
        ({"holidays": "XY", "away": True}, "no holidays are known of 'XY'"),
        ({"holidays": "DE-XY", "away": True}, "no holidays are known of 'DE-XY'"),
    ],
)
def test_what_is_no_event_is_refused(event, message):
    pytest.importorskip("holidays")
    with pytest.raises(ValidationError, match=message):
        persona(event=event)


def test_a_household_becomes_nobody_else_and_names_templates_of_its_members():
    for event, message in (
        ({"once": "2026-01-01", "becomes": "retired"}, "only a member"),
        ({"once": "2026-01-01", "days": "weekday"}, "did you mean 'weekdays'"),
    ):
        with pytest.raises(ValidationError, match=message):
            Household.model_validate({"members": {"ana": "works_outside"}, "year": {"x": event}})


def test_a_night_too_short_before_an_event_is_refused():
    with pytest.raises(ValidationError, match="too short a night"):
        persona("night_shift", flu=FLU)


def test_every_bundled_template_can_follow_the_days_of_who_sleeps_at_night():
    for name in ("child", "retired", "student", "works_from_home", "works_outside"):
        year = {day: {"every": "30 d", "lasts": "2 d", "days": day} for day in bundled_days()}
        own = Life(persona(name, **year), 4, "users.ana")
        for ordinal in range(MONDAY, MONDAY + 120):
            today, after = own.day(ordinal), own.day(ordinal + 1)
            assert today[-1].end == after[0].begin + 86_400
