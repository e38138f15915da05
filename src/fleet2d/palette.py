"""Colours that all pictures, films and pages share.

The colours of bodies can be distinguished with any kind of colour blindness (after Paul Tol's
vibrant and muted schemes), on a light and on a dark background. Rooms are pale, so that text on
them is legible.
"""

from types import MappingProxyType

USER_COLORS = ("#aa3377", "#0077bb", "#009988", "#ee7733", "#cc3311", "#33bbee")
ROBOT_COLORS = ("#22344f", "#5a4634", "#3d3a63", "#2f5148")
VIEW_COLOR = "#0e9e9a"
VIEW_EDGE = "#0b7d7a"
DOOR_COLOR = "#8a5a2b"
DEEPER = 1.9
"""Factor of a room colour's distance from white in a timeline, whose lanes are thin."""

SHADES = (1.0, 1.5, 0.7, 2.0)
"""The same for rooms of one type, in turn."""

ROOM_COLORS = MappingProxyType(
    {
        "living_room": "#f6e3c5",
        "dining_room": "#f7edb8",
        "kitchen": "#f9d5bb",
        "bedroom": "#c9dcf2",
        "child_room": "#d3e8f7",
        "guest_room": "#bfd0ea",
        "bathroom": "#bfe5e3",
        "toilet": "#d2efec",
        "office": "#ddd2ee",
        "gym": "#f2cfd8",
        "laundry": "#d3dcd6",
        "storage": "#dcd8cc",
        "wardrobe": "#e3d6d9",
        "boiler_room": "#d6d2cc",
        "garage": "#d4d6da",
        "entryway": "#ece3d8",
        "lobby": "#ece3d8",
        "hallway": "#f1ece4",
        "hall": "#f1ece4",
        "balcony": "#d3e8c8",
        "loggia": "#d3e8c8",
        "terrace": "#cfe6c0",
        "room": "#e9e2c9",
        "unknown": "#f4f4f2",
    }
)
OTHER_COLOR = "#e6dcea"
WALL_COLOR = "#3b4048"
BORDER_COLOR = "#9a9da3"
TEXT_COLOR = "#2d3138"
ACCENT_COLOR = "#c8452f"


def room_color(kind: str, number: int = 0) -> str:
    """Return the colour of a room on a floor plan by its type, and its number within the type.

    >>> room_color("bedroom"), room_color("bedroom", 1)
    ('#c9dcf2', '#aecbeb')
    """
    return _deeper(ROOM_COLORS.get(kind, OTHER_COLOR), SHADES[number % len(SHADES)])


def deep_color(kind: str, number: int = 0) -> str:
    """Return the colour of a room in a timeline; see `room_color`.

    >>> deep_color("bedroom")
    '#98bce6'
    """
    return _deeper(ROOM_COLORS.get(kind, OTHER_COLOR), DEEPER * SHADES[number % len(SHADES)])


def _deeper(color: str, factor: float) -> str:
    """Return a colour whose distance from white is multiplied."""
    parts = (int(color[i : i + 2], 16) / 255 for i in (1, 3, 5))
    deep = (max(0.0, 1 - factor * (1 - part)) for part in parts)
    return "#" + "".join(f"{round(255 * part):02x}" for part in deep)


def body_color(number: int, *, robot: bool) -> str:
    """Return the colour of a robot or user by its number."""
    colors = ROBOT_COLORS if robot else USER_COLORS
    return colors[number % len(colors)]
