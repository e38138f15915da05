"""Frames of logs: any similarity is undone, exactly told or fitted to matches."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fleet2d.logs.log import LogError
from fleet2d.logs.placement import LogFrame, map_rooms

NUMBER = st.floats(-50, 50)


def named_room(kind, *functions):
    """Return what is used of a room: its name, its type, and what it may be called by."""
    name = f"{kind}_1"
    return SimpleNamespace(name=name, type=kind, words=(name, kind, *functions))


@given(
    scale=st.floats(0.001, 100),
    degrees=st.floats(-720, 720),
    flip=st.booleans(),
    origin=st.tuples(NUMBER, NUMBER),
)
def test_a_frame_does_what_complex_numbers_do_and_matches_find_it_again(
    scale, degrees, flip, origin
):
    frame = LogFrame(scale=scale, rotation_deg=degrees, flip_y=flip, origin=origin)
    log = np.array([[0.0, 0.0], [10.0, 0.0], [3.0, 7.0]])
    z = log[:, 0] + 1j * (-log[:, 1] if flip else log[:, 1])
    w = scale * np.exp(1j * np.radians(degrees)) * z + complex(*origin)
    expected = np.stack([w.real, w.imag], 1)
    assert expected == pytest.approx(frame.to_plan(log), abs=1e-9 * (1 + scale))
    matches = [{"log": a, "plan": b} for a, b in zip(log.tolist(), expected.tolist(), strict=True)]
    fitted = LogFrame(flip_y=flip, matches=matches)
    assert expected == pytest.approx(fitted.to_plan(log), abs=1e-6 * (1 + scale))
    assert fitted.errors().max() < 1e-6 * (1 + scale)


def test_headings_turn_and_mirror_with_the_frame():
    east, north = 0.0, 0.25
    turned = LogFrame(rotation_deg=90).turn_headings(np.array([east, north]))
    assert [0.25, 0.5] == pytest.approx(turned.tolist())
    mirrored = LogFrame(flip_y=True).turn_headings(np.array([east, north]))
    assert [0.0, -0.25] == pytest.approx(mirrored.tolist())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scale": 2, "matches": [{"log": (0, 0), "plan": (0, 0)}]}, "not both"),
        ({"matches": [{"log": (0, 0), "plan": (0, 0)}]}, "two different places"),
        ({"scale": 0}, "greater than 0"),
    ],
)
def test_a_frame_that_says_too_much_or_too_little_is_refused(settings, message):
    with pytest.raises(ValidationError, match=message):
        LogFrame.model_validate(settings)


@pytest.mark.parametrize(
    ("label", "kinds", "proposal"),
    [
        ("Office", ["garage", "bedroom"], "bedroom"),
        ("Kitchen", ["garage", "living_room"], "living_room"),
        ("Toilet", ["bedroom", "garage"], "bedroom"),
        ("Bedrom", ["garage", "living_room", "bedroom"], "bedroom"),  # misspelled
        ("Sauna", ["garage", "living_room"], "living_room"),
    ],
)
def test_a_label_without_its_room_proposes_the_most_similar_one(label, kinds, proposal):
    rooms = [named_room(kind) for kind in kinds]
    with pytest.raises(LogError, match=rf"rooms: {{{label}: {proposal}}}, or another: "):
        map_rooms({label: 3}, {}, rooms)


def test_a_label_means_the_first_of_its_rooms_that_the_home_has():
    rooms = [named_room("toilet")]
    known = map_rooms({"Sink": 3, "Sofa": 1}, {"Sink": ("bathroom", "toilet"), "Sofa": None}, rooms)
    assert known == {"Sink": ("toilet",), "Sofa": None}


def test_a_kitchenette_in_the_living_room_is_the_kitchen_of_a_log():
    # `examples/transfer/presence.yaml` couldn't be run: its first home has no other kitchen.
    rooms = [named_room("living_room", "kitchen"), named_room("bedroom")]

    mapped = map_rooms({"Kitchen": 3, "Sleeping": 2, "fridge": 1}, {}, rooms)

    assert mapped == {"Kitchen": ("kitchen",), "Sleeping": ("bedroom",), "fridge": ("kitchen",)}
