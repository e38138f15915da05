"""Room types: the vocabulary, other names of its types, and which of several types leads."""

import re

UNKNOWN = "unknown"

# HouseExpo's 25 categories, as `room_type` spells them. The order decides the type of a room with
# several labels: living spaces come first, special types before general ones (a child's room is a
# bedroom), and catch-alls last.
PRIORITY = (
    "kitchen",
    "child_room",
    "guest_room",
    "bedroom",
    "living_room",
    "bathroom",
    "dining_room",
    "office",
    "toilet",
    "laundry",
    "gym",
    "garage",
    "boiler_room",
    "wardrobe",
    "storage",
    "entryway",
    "lobby",
    "hallway",
    "hall",
    "balcony",
    "loggia",
    "terrace",
    "passenger_elevator",
    "freight_elevator",
    "aeration",
)
_LAST = ("room", UNKNOWN)

ALSO_CALLED = {
    "kitchen": ("kitchenette", "küche", "cuisine", "cocina", "cucina", "keuken"),
    "child_room": (
        *("children_s_room", "kids_room", "nursery", "kinderzimmer", "chambre_d_enfant"),
        *("cuarto_de_niños", "cameretta", "kinderkamer"),
    ),
    "guest_room": ("gästezimmer", "chambre_d_amis", "habitación_de_invitados", "logeerkamer"),
    "bedroom": (
        *("schlafzimmer", "chambre", "dormitorio", "habitación", "camera", "camera_da_letto"),
        "slaapkamer",
    ),
    "living_room": (
        *("lounge", "family_room", "wohnzimmer", "salon", "séjour", "salón", "sala_de_estar"),
        *("soggiorno", "salotto", "woonkamer"),
    ),
    "bathroom": (
        *("bath", "bad", "badezimmer", "salle_de_bain", "salle_de_bains", "baño"),
        *("cuarto_de_baño", "bagno", "badkamer"),
    ),
    "dining_room": (
        *("dining_area", "esszimmer", "essbereich", "salle_à_manger", "comedor"),
        *("sala_da_pranzo", "eetkamer"),
    ),
    "office": (
        *("study", "home_office", "büro", "arbeitszimmer", "bureau", "oficina", "despacho"),
        *("ufficio", "kantoor", "werkkamer"),
    ),
    "toilet": ("wc", "restroom", "gäste_wc", "toilette", "toilettes", "aseo", "gabinetto"),
    "laundry": (
        *("laundry_room", "utility_room", "waschküche", "buanderie", "lavadero", "lavanderia"),
        "wasruimte",
    ),
    "gym": ("fitness_room", "fitnessraum"),
    "garage": ("car_port", "carport", "garaje", "box_auto"),
    "boiler_room": ("heizungsraum", "chaufferie"),
    "wardrobe": (
        *("closet", "walk_in_closet", "cloakroom", "dressing", "ankleide", "garderobe"),
        *("vestidor", "cabina_armadio", "inloopkast"),
    ),
    "storage": (
        *("storage_room", "pantry", "abstellraum", "vorratskammer", "cellier", "débarras"),
        *("trastero", "despensa", "ripostiglio", "berging"),
    ),
    "entryway": ("entrance", "entry", "foyer", "eingang", "entrée", "entrada", "ingresso"),
    "hallway": (
        *("corridor", "flur", "diele", "couloir", "pasillo", "corridoio", "gang"),
        "overloop",
    ),
    "balcony": ("balkon", "balcon", "balcón", "balcone"),
    "terrace": ("patio", "deck", "terrasse", "terraza", "terrazza", "terras"),
}
"""Other names of room types, as people and apps use them, in English, German, French, Spanish,
Italian and Dutch."""
_TYPE_OF = {kind: kind for kind in PRIORITY} | {
    name: kind for kind, names in ALSO_CALLED.items() for name in names
}


def room_type(label: str) -> str:
    """Return the snake_case room type that a label in a floor plan file means.

    Example:
        >>> room_type("Child_Room"), room_type("Living room"), room_type("Yoga-Studio ")
        ('child_room', 'living_room', 'yoga_studio')
        >>> room_type("  ")
        'unknown'
    """
    words = re.findall(r"[^\W_]+", label.lower())
    return "_".join(words) or UNKNOWN


def usual_type(name: str) -> str:
    """Return the room type that a room's name means, from the vocabulary where it has one.

    The last words decide, then the first ones; a trailing number is ignored.

    Example:
        >>> usual_type("Master Bedroom"), usual_type("Küche"), usual_type("Bedroom 2")
        ('bedroom', 'kitchen', 'bedroom')
        >>> usual_type("Salle de bain"), usual_type("Chambre parentale")
        ('bathroom', 'bedroom')
        >>> usual_type("Yoga Studio 3")
        'yoga_studio_3'
    """
    own = room_type(name)
    words = own.split("_")
    while len(words) > 1 and words[-1].isdigit():
        words.pop()
    endings = ["_".join(words[first:]) for first in range(len(words))]
    beginnings = ["_".join(words[:last]) for last in range(len(words) - 1, 0, -1)]
    types = (_TYPE_OF[part] for part in (*endings, *beginnings) if part in _TYPE_OF)
    return next(types, own)


def leading_type(types: tuple[str, ...]) -> str:
    """Return the type of a room that carries all of `types`.

    Types outside the vocabulary come after those in it; of several such types the first wins.

    Example:
        >>> leading_type(("toilet", "bathroom"))
        'bathroom'
        >>> leading_type(("room", "yoga_studio"))
        'yoga_studio'
    """
    return min(types, key=_rank) if types else UNKNOWN


def _rank(kind: str) -> int:
    if kind in PRIORITY:
        return PRIORITY.index(kind)
    if kind in _LAST:
        return len(PRIORITY) + 1 + _LAST.index(kind)
    return len(PRIORITY)
