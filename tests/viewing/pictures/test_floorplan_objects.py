"""Furniture, doorways and areas to keep out of are drawn where they are."""

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.colors import to_rgb
from tests.viewing.pictures.test_floorplan import pixels, words

from fleet2d.floorplan.checkup import checkup
from fleet2d.floorplan.furniture import stand_furniture
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import DoorLine
from fleet2d.viewing.pictures.floorplan import draw_checkup, draw_floorplan

BOX = shapely.box(0, 0, 8, 6)


def home(**parts):
    return FloorPlan.build("home", BOX, [LabelledRegion(("bedroom",), BOX)], **parts)  # type: ignore[arg-type]


def test_furniture_is_drawn_as_its_symbol_with_its_front_where_it_looks():
    things = [
        stand_furniture("table", (2.0, 4.0), size=(2.0, 1.0)),
        stand_furniture("bed", (6.0, 3.0), size=(1.6, 2.0)),
    ]
    # People lie with their heads at the back: the blanket is at the front, in the north.
    table, blanket, back = pixels(
        home(objects=things), (2.7, 4.22), (6.0, 3.6), (6.0, 2.05), names=False
    )

    assert np.allclose(to_rgb("#c99f6c"), table, atol=0.02)
    assert np.allclose(to_rgb("#9fb0c9"), blanket, atol=0.02)
    assert np.allclose(to_rgb("#b98c58"), back, atol=0.02)


def test_what_blocks_nothing_is_seen_through():
    empty, rug = home(), home(objects=[stand_furniture("rug", (2.0, 4.0))])
    (floor,), (over,) = (pixels(plan, (2.0, 4.0), names=False) for plan in (empty, rug))

    opaque = np.array(to_rgb("#b9a58c"))
    assert np.allclose(0.6 * np.array(floor) + 0.4 * opaque, over, atol=0.02)


def test_door_is_drawn_at_its_line_and_its_swing():
    wall = shapely.box(3.9, 0, 4.1, 2).union(shapely.box(3.9, 3, 4.1, 6))
    free = BOX.difference(wall)
    shut, gap = (
        FloorPlan.build("two", free, doorways=[DoorLine((4, 2), (4, 3), leaf=leaf)])
        for leaf in (True, False)
    )
    # The leaf stands open to the left of the line from jamb to jamb.
    jamb, left = np.array(shut.doorways[0].start), np.array([-0.5, 0.0])
    leaf = tuple(jamb + left)
    assert pixels(shut, leaf, names=False) != pixels(gap, leaf, names=False)


def test_names_of_rooms_keep_off_the_furniture():
    plan = home(objects=[stand_furniture("workbench", (4.0, 3.0), size=(4.0, 4.0))])

    assert "workbench" in words(plan)
    assert any("Bedroom" in text for text in words(plan))


def test_check_up_is_drawn_with_numbers_and_sentences(tmp_path):
    shed = shapely.box(10, 0, 13, 3)
    plan = FloorPlan.build(
        "home",
        shapely.union_all([BOX, shed]),
        [LabelledRegion(("bedroom",), BOX), LabelledRegion(("storage",), shed)],
        no_go=[shapely.box(1, 1, 2, 2)],
    )
    first, second = tmp_path / "a.svg", tmp_path / "b.svg"
    with mpl.rc_context({"svg.fonttype": "none"}):
        for path in (first, second):
            draw_checkup(plan, checkup(plan), path)

    assert first.read_bytes() == second.read_bytes()
    draw_checkup(plan, [], tmp_path / "none.png")
    draw_floorplan(plan, tmp_path / "plan.png")
    assert (tmp_path / "none.png").read_bytes() != (tmp_path / "plan.png").read_bytes()
