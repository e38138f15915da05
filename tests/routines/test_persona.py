"""Personas that extend others, what interrupts their stays, and how long they are out."""

import pytest
from pydantic import TypeAdapter, ValidationError
from tests.routines.days import MONDAY

from fleet2d.routines.activity import find_activity
from fleet2d.routines.life import Life
from fleet2d.routines.persona import AnyPersona, bundled_persona

HOUR = 3600


def read(value):
    return TypeAdapter(AnyPersona).validate_python(value)


def test_of_several_personas_each_changes_those_before_it(tmp_path):
    (tmp_path / "slow.yaml").write_text("pace: 0.5\nabout: slow\n")
    extended = read({"extends": ["student", str(tmp_path / "slow.yaml")], "about": "mine"})
    assert (0.5, "mine") == (extended.pace, extended.about)
    assert bundled_persona("student").days == extended.days


@pytest.mark.parametrize(("needs", "fetches"), [("", False), ("needs: {pick_up: null}\n", True)])
def test_short_stays_take_the_place_of_fetches(needs, fetches, tmp_path):
    own = "activities: {tv: {rooms: [office], fetches: 5 min}}\n"
    (tmp_path / "ana.yaml").write_text(f"days: {{every: {{on: daily}}}}\n{own}{needs}")
    persona = read(str(tmp_path / "ana.yaml"))
    assert fetches == persona.fetches
    assert fetches == (persona.activity("tv").fetches is not None)
    assert fetches == (persona.activity("read").fetches is not None)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"extends": ["retired", "students"]}, "did you mean 'student'"),
        ({"extends": ["retired", 3]}, "expected a persona, got 3"),
        ({"extends": []}, "days"),
    ],
)
def test_a_wrong_extension_is_an_error_that_says_what_to_write(value, words):
    with pytest.raises(ValidationError, match=r"(?s)" + words.replace("[", r"\[")):
        read(value)


@pytest.mark.parametrize(("name", "often"), [("retired", 1.9), ("retired_active", 3.0)])
def test_the_retired_are_out_for_2_to_4_h_a_day(name, often):
    """The American Time Use Survey has 3.0 outings and 2.2 h a day of the retired."""
    persona = bundled_persona(name)
    life, days = Life(persona, 4, "users.ana"), 140
    outings, out_s = 0, 0
    for ordinal in range(MONDAY, MONDAY + days):
        was_out = False
        for episode in life.day(ordinal):
            is_out = find_activity(episode.activity, persona.activities).away
            outings += is_out and not was_out
            out_s += is_out * (episode.end - episode.begin)
            was_out = is_out
    assert often == pytest.approx(outings / days, abs=0.25)
    assert 2 < out_s / HOUR / days < 4


def test_a_persona_of_which_only_a_key_is_given_is_told_to_extend_another_one():
    with pytest.raises(ValidationError, match="a persona needs days, or"):
        read({"pace": 2})
