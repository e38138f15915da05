"""Entries of a script: an intervention, written by its verb, and when it is done."""

import pytest
from tests.scenes import entries

from fleet2d.errors import ScenarioError
from fleet2d.interventions.intervention import (
    ENTRY_KEYS,
    Entry,
    dump_intervention,
    parse_entry,
    parse_intervention,
    verbs,
)

EACH = entries(
    """
    put: ana, to: kitchen, heading_deg: 90
    send: ana, to: [1, 2], duration: 1 h
    hold: astro
    activity: ana, what: dinner, to: sofa
    call: astro, find: ana
    call: astro, dock: true
    shut: bath_door
    move: sofa_1, to: [1, 2], turn_deg: 90
    room: office_1, type: bedroom
    """
)


@pytest.mark.parametrize("content", EACH, ids=lambda content: next(iter(content)))
def test_an_entry_is_read_as_it_is_written_in_short_and_in_long(content):
    entry = Entry.model_validate({"at": "19:00", **content})
    verb, subject = next(iter(content.items()))
    assert verb == entry.act.type_name
    assert subject == getattr(entry.act, entry.act.subject)
    assert entry == Entry.model_validate(entry.model_dump(mode="json"))
    assert entry.act == parse_intervention(dump_intervention(entry.act))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("at: 1 h", "the key of the intervention is missing"),
        ("at: 1 h, holdd: ana", "did you mean 'hold'"),
        ("at: 1 h, hold: ana, put: ana", "exactly one of hold and put"),
        ("at: 1 h, do: holdd, entity: ana", "do: there is no intervention 'holdd'"),
        ("at: 1 h, do: 'os:system'", "no intervention 'os:system'"),
        ("at: 1 h, hold: ana, entity: ben", "leave out 'entity'"),
        ("at: 1 h, hold: 3", "^hold: "),
        ("at: 1 h, put: ana", "^to: "),
        ("at: 1 h, put: ana, to: k, too: 3", "too: unknown key"),
        ("at: 1 h, call: astro", "one of 'to', 'find'"),
        ("at: 1 h, call: astro, to: kitchen, dock: true", "one of 'to', 'find'"),
        ("hold: ana, each: true", "exactly one of 'at'"),
        ("at: 1 h, on: docks, hold: ana", "exactly one of 'at'"),
        ("at: 1 h, each: true, hold: ana", "'each' goes with"),
        ("at: 1 h, delay: 5 s, hold: ana", "'delay' is the time after"),
    ],
)
def test_a_wrong_entry_is_refused_and_says_what_is_wrong(content, words):
    (entry,) = entries(content)
    with pytest.raises(ScenarioError, match=words):
        parse_entry(entry)


def test_no_key_of_an_intervention_is_a_verb_or_has_a_meaning_beside_it():
    taken = {*verbs(), *ENTRY_KEYS, "do", "step", "by"}
    for verb, cls in verbs().items():
        assert cls.subject in cls.model_fields
        assert not taken & (cls.model_fields.keys() - {cls.subject}), verb
