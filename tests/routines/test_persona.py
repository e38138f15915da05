"""Personas that extend others: several at once, and parts that change any of them."""

from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError
from tests.routines.days import MONDAY

from fleet2d.configuration.documents import read_document
from fleet2d.routines.activity import catalogue, find_activity
from fleet2d.routines.interruptions import usual_needs
from fleet2d.routines.life import Life
from fleet2d.routines.persona import PARTS, AnyPersona, Persona, bundled_persona, part_names

HOUR = 3600


def read(value: Any) -> Persona:
    return TypeAdapter(AnyPersona).validate_python(value)


def test_of_several_personas_each_changes_those_before_it(tmp_path: Path) -> None:
    (tmp_path / "slow.yaml").write_text("pace: 0.5\nabout: slow\n")
    extended = read({"extends": ["student", str(tmp_path / "slow.yaml")], "about": "mine"})
    assert (0.5, "mine") == (extended.pace, extended.about)
    assert bundled_persona("student").days == extended.days


@pytest.mark.parametrize("part", part_names())
def test_a_part_adds_its_needs_and_leaves_the_rest(part: str) -> None:
    added = read_document(PARTS / f"{part}.yaml").data
    for base in ("child", "works_outside"):
        extended = read({"extends": [base, part]})
        assert {*bundled_persona(base).needs, *added["needs"]} == set(extended.needs)
        assert bundled_persona(base).days == extended.days


def test_a_part_adds_to_the_needs_of_an_adult_that_a_persona_has_by_default(
    tmp_path: Path,
) -> None:
    (tmp_path / "ana.yaml").write_text("days: {every: {on: daily}}\n")
    extended = read({"extends": [str(tmp_path / "ana.yaml"), "short_stays"]})
    assert {*usual_needs(), "pick_up", "freshen_up"} == set(extended.needs)


def test_short_stays_take_the_place_of_fetches_and_of_the_errands_of_an_adult(
    tmp_path: Path,
) -> None:
    own = "activities: {tv: {rooms: [office], fetches: 5 min}}\n"
    (tmp_path / "ana.yaml").write_text(f"days: {{every: {{on: daily}}}}\n{own}")
    extended = read({"extends": [str(tmp_path / "ana.yaml"), "short_stays"]})
    assert {"check_door"} == set(extended.errands)
    reading = extended.activity("read")
    assert catalogue()["read"].model_copy(update={"fetches": None}) == reading
    assert (("office",), None) == (extended.activity("tv").rooms, extended.activity("tv").fetches)
    assert read(str(tmp_path / "ana.yaml")).activity("tv").fetches is not None


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("short_stays", "extends: [retired, short_stays]"),
        ({"extends": ["retired", "short_stay"]}, "did you mean 'short_stays'"),
        ({"extends": ["retired", 3]}, "expected a persona, got 3"),
        ({"extends": []}, "days"),
    ],
)
def test_a_wrong_extension_is_an_error_that_says_what_to_write(value: Any, words: str) -> None:
    with pytest.raises(ValidationError, match=r"(?s)" + words.replace("[", r"\[")):
        read(value)


def test_who_is_retired_and_active_is_out_three_times_a_day() -> None:
    """The American Time Use Survey has 3.0 outings and 2.2 h a day of the retired."""
    persona = bundled_persona("retired_active")
    life, days = Life(persona, 4, "users.ana"), 140
    outings, out_s = 0, 0
    for ordinal in range(MONDAY, MONDAY + days):
        was_out = False
        for episode in life.day(ordinal):
            is_out = find_activity(episode.activity, persona.activities).away
            outings += is_out and not was_out
            out_s += is_out * (episode.end - episode.begin)
            was_out = is_out
    assert 3.0 == pytest.approx(outings / days, abs=0.25)
    assert 2.2 < out_s / HOUR / days < 4.2  # the survey, and real homes


def test_short_stays_interrupt_a_stay_for_less_than_minutes() -> None:
    lived = Life(read({"extends": ["works_from_home", "short_stays"]}), 4, "users.ana")
    took = [
        episode.end - episode.begin
        for ordinal in range(MONDAY, MONDAY + 28)
        for episode in lived.day(ordinal)
        if episode.activity == "pick_up"
    ]
    assert 20 * 28 < len(took) < 40 * 28
    assert timedelta(minutes=4).total_seconds() >= max(took)
    assert sorted(took)[len(took) // 2] < 60
