"""Colours stay distinct for readers who see fewer: simulated by Machado et al. (2009), full severity."""

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from fleet2d.palette import ROOM_COLORS, SHADES, TEXT_COLOR, USER_COLORS, deep_color, room_color

THEME = Path(__file__).parents[1] / "page" / "src" / "theme.ts"
VISION = {
    "usual": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def linear(color) -> np.ndarray:
    parts = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def lab(color, vision) -> np.ndarray:
    """Return CIELAB (D65) of a colour as somebody sees it."""
    seen = np.clip(np.asarray(VISION[vision]) @ linear(color), 0, 1)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = np.asarray(to_xyz) @ seen / [0.9505, 1, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def nearest(colors, vision):
    points = [lab(color, vision) for color in colors]
    return min(float(np.linalg.norm(a - b)) for a, b in combinations(points, 2))


def contrast(one, other):
    light, dark = sorted(linear(c) @ [0.2126, 0.7152, 0.0722] + 0.05 for c in (one, other))[::-1]
    return float(light / dark)


def words():
    match = re.search(r"PALETTE = \[(.*?)\]", THEME.read_text(encoding="utf-8"))
    assert match
    return re.findall(r"#[0-9a-f]{6}", match[1])


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("palette", ["users", "words"])
def test_colours_are_distinct_with_any_colour_vision(palette, vision):
    colors = list(USER_COLORS) if palette == "users" else words()
    assert nearest(colors, vision) > 10


@pytest.mark.parametrize("vision", VISION)
def test_rooms_of_one_type_differ_in_shade(vision):
    for kind in ("bedroom", "bathroom", "child_room", "office"):
        for color in (room_color, deep_color):
            assert nearest([color(kind, i) for i in range(len(SHADES))], vision) > 3


def test_names_are_legible_on_every_room():
    for kind in ROOM_COLORS:
        for number in range(len(SHADES)):
            assert contrast(TEXT_COLOR, room_color(kind, number)) > 4.5, kind
