from collections import Counter

import pytest

from fleet2d.floorplan.rooms.room import (
    ALSO_CALLED,
    PRIORITY,
    leading_type,
    room_type,
    usual_type,
    usual_types,
)

HOUSEEXPO = [
    "Bedroom",
    "Bathroom",
    "Toilet",
    "Kitchen",
    "Room",
    "Living_Room",
    "Office",
    "Dining_Room",
    "Garage",
    "Hallway",
    "Hall",
    "Child_Room",
    "Gym",
    "Storage",
    "Balcony",
    "Wardrobe",
    "Guest_Room",
    "Lobby",
    "Entryway",
    "Terrace",
    "Loggia",
    "Boiler_room",
    "Aeration",
    "Passenger_elevator",
    "Freight_elevator",
]


def test_room_type_of_every_houseexpo_category_is_known():
    known = {*PRIORITY, "room"}

    assert 25 == len(HOUSEEXPO)
    assert set() == {room_type(label) for label in HOUSEEXPO} - known


def test_leading_type_prefers_living_to_catch_alls():
    assert "bathroom" == leading_type(("toilet", "bathroom"))
    assert "child_room" == leading_type(("bedroom", "child_room"))
    assert "sauna" == leading_type(("room", "sauna", "attic"))
    assert "gym" == leading_type(("sauna", "gym"))
    assert "unknown" == leading_type(())


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("Kitchen", "kitchen"),
        ("living room", "living_room"),
        ("Master Bedroom", "bedroom"),
        ("Bedroom 2", "bedroom"),
        ("Guest Room", "guest_room"),
        ("Entrance", "entryway"),
        ("Küche", "kitchen"),
        ("WC", "toilet"),
        ("Gäste-WC", "toilet"),
        ("Chambre d'amis", "guest_room"),
        ("Chambre parentale", "bedroom"),
        ("Salle de bains 2", "bathroom"),
        ("Cuarto de baño", "bathroom"),
        ("Yoga Studio", "yoga_studio"),
        ("Dressing Room", "wardrobe"),
        ("Room 5", "room_5"),
        ("42", "42"),
        ("  ", "unknown"),
    ],
)
def test_usual_type_goes_by_the_words_of_a_name(name, kind):
    assert kind == usual_type(name)


def test_every_other_name_is_spelled_as_labels_are_and_means_its_types():
    names = [name for names in ALSO_CALLED.values() for name in names]

    assert set() == set(ALSO_CALLED) - set(PRIORITY)
    assert names == [room_type(name) for name in names]
    assert ["kitchen_diner", "wohnküche"] == sorted(n for n, c in Counter(names).items() if c > 1)
    for kind, others in ALSO_CALLED.items():
        assert all(kind in usual_types(name) for name in others)
    assert set() == set(names) & set(PRIORITY)


@pytest.mark.parametrize(
    ("name", "types"),
    [
        ("Kitchen / Living room", ("kitchen", "living_room")),
        ("Wohn- und Esszimmer", ("living_room", "dining_room")),
        ("Wohnküche", ("kitchen", "living_room")),
        ("Cuisine et salon", ("kitchen", "living_room")),
        ("Cocina, comedor", ("kitchen", "dining_room")),
        ("Living + Dining 2", ("living_room", "dining_room")),
        ("Ana & Ben's bedroom", ("bedroom",)),
        ("Study", ("office",)),
        ("Salle de bain", ("bathroom",)),
        ("Yoga Studio", ("yoga_studio",)),
    ],
)
def test_a_name_means_all_uses_of_its_room(name, types):
    assert types == usual_types(name)
    assert usual_type(name) in types
