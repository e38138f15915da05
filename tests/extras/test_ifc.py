import math
from pathlib import Path

import pytest
import shapely
from tests.small_home import INNER_M, OUTER_M, VARIATIONS, check, small_home

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.ifc import Ifc

ifcopenshell = pytest.importorskip("ifcopenshell")

Box = tuple[float, float, float, float]


class Model:
    """An IFC model of boxes, written by ifcopenshell's own functions in millimetres."""

    def __init__(self, storeys, schema="IFC4", turn=0.0):
        from ifcopenshell.api import aggregate, context, project, root, unit

        self.turn = turn
        self.file = project.create_file(version=schema)
        top = root.create_entity(self.file, ifc_class="IfcProject", name="flat")
        unit.assign_unit(self.file)
        model = context.add_context(self.file, context_type="Model")
        self.body = context.add_context(
            self.file,
            context_type="Model",
            context_identifier="Body",
            target_view="MODEL_VIEW",
            parent=model,
        )
        building = root.create_entity(self.file, ifc_class="IfcBuilding")
        aggregate.assign_object(self.file, products=[building], relating_object=top)
        self.storeys = {
            name: root.create_entity(self.file, ifc_class="IfcBuildingStorey", name=name)
            for name in storeys
        }
        for name, storey in self.storeys.items():
            storey.Elevation = storeys[name] * 1000
            self._place(storey, storeys[name])
            aggregate.assign_object(self.file, products=[storey], relating_object=building)

    def _place(self, element, z):
        import numpy as np
        from ifcopenshell.api import geometry

        matrix = np.eye(4)
        if not element.is_a("IfcBuildingStorey"):
            c, s = math.cos(self.turn), math.sin(self.turn)
            matrix[:2, :2] = [[c, -s], [s, c]]
        matrix[2, 3] = z
        geometry.edit_object_placement(self.file, product=element, matrix=matrix)

    def add(
        self,
        kind,
        box: Box,
        name: str | None = None,
        storey="Ground",
        z: tuple[float, float] = (0.0, 2.5),
        **keys,
    ):
        """Add a box (x0, y0, x1, y1) [m] of a class; `z` is its bottom and top above the storey."""
        from ifcopenshell.api import aggregate, geometry, root, spatial

        element = root.create_entity(self.file, ifc_class=kind, name=name)
        for key, value in keys.items():
            setattr(element, key, value)
        x0, y0, x1, y1 = box
        corners = [(x, y, h) for h in z for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
        faces = [(3, 2, 1, 0), (4, 5, 6, 7)] + [
            (k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4) for k in range(4)
        ]
        shape = geometry.add_mesh_representation(
            self.file, context=self.body, vertices=[corners], faces=[faces]
        )
        geometry.assign_representation(self.file, product=element, representation=shape)
        self._place(element, self.storeys[storey].Elevation / 1000)
        if kind == "IfcSpace":
            aggregate.assign_object(
                self.file, products=[element], relating_object=self.storeys[storey]
            )
        else:
            spatial.assign_container(
                self.file, products=[element], relating_structure=self.storeys[storey]
            )

    def write(self, folder: Path) -> Path:
        path = folder / "flat.ifc"
        self.file.write(str(path))
        return path


def flat(schema="IFC4", spaces=True) -> Model:
    """Two rooms of 4 m x 4 m beside each other, and a storey above."""
    model = Model({"Up": 2.8, "Ground": 0.0, "Cellar": -2.5}, schema)
    for storey in ("Ground", "Up"):
        for wall in ((-0.2, -0.2, 8.4, 0), (-0.2, 4, 8.4, 4.2), (-0.2, 0, 0, 4), (8.2, 0, 8.4, 4)):
            model.add("IfcWall", wall, storey=storey)
    model.add("IfcWall", (4, 0, 4.2, 4))
    if spaces:
        model.add("IfcSpace", (0, 0, 4, 4), "1", LongName="Kitchen")
        model.add("IfcSpace", (4.2, 0, 8.2, 4), "2", LongName="Schlafzimmer")
        model.add("IfcSpace", (0, 0, 8.2, 4), "3", "Up", LongName="Studio")
    model.add("IfcDoor", (4.02, 0.5, 4.18, 1.4), z=(0, 2.1))
    model.add("IfcWindow", (4.02, 2, 4.18, 3.5), z=(0.9, 2.1))
    model.add("IfcWindow", (-0.15, 1, -0.05, 2), z=(0.9, 2.1))
    model.add("IfcWindow", (4.02, 3.6, 4.18, 3.9), z=(1.9, 2.2))
    model.add("IfcFurnishingElement", (6, 2, 7.6, 4), "Bed 160 x 200", z=(0, 0.5))
    model.add("IfcFurnishingElement", (5, 3.7, 6, 4), "Shelf", z=(1.5, 1.8))
    return model


def test_furniture_is_as_high_above_its_storey_as_the_model_says(tmp_path):
    model = flat()
    model.add("IfcFurnishingElement", (0.5, 2, 2, 3), "Sideboard", storey="Up", z=(0, 0.9))
    model.add("IfcFurnishingElement", (4, 2, 5, 3), "Table", storey="Up", z=(0, 0.75))
    path = model.write(tmp_path)

    assert [0.5] == [thing.height for thing in Ifc(path=path, level="Ground").load().objects]
    assert [0.9, None] == [thing.height for thing in Ifc(path=path, level="Up").load().objects]


@pytest.mark.parametrize("schema", ["IFC4", "IFC4X3"])
def test_spaces_doors_windows_and_furniture_of_the_ground_floor_become_a_home(tmp_path, schema):
    plan = Ifc(path=flat(schema).write(tmp_path), level="Ground").load()

    assert [("Kitchen", "kitchen"), ("Schlafzimmer", "bedroom")] == [
        (room.name, room.type) for room in plan.rooms
    ]
    assert plan.area_m2 == pytest.approx(32 + 0.2 * 0.9, abs=0.05)
    assert [(0, 1)] == [tuple(sorted(door.rooms)) for door in plan.doorways]
    assert plan.doorways[0].width_m == pytest.approx(0.9, abs=0.01)
    assert ["bed"] == [thing.type for thing in plan.objects]
    (pane,) = shapely.transform(plan.glass, plan.lattice.to_metres)
    assert (3.99, 2, 4.21, 3.5) == pytest.approx(pane.bounds, abs=0.002)
    assert "of its levels, Ground is used, not Cellar, Up" in plan.notes
    assert "windows in outer walls, through which nobody is seen: 1" in plan.notes


def test_a_storey_can_be_named_and_without_spaces_walls_enclose_the_home(tmp_path):
    path = flat().write(tmp_path)
    walls_only = Ifc(path=flat(spaces=False).write(tmp_path), level="Ground").load()

    assert 2 == len(walls_only.rooms)
    assert walls_only.area_m2 == pytest.approx(32.2, abs=0.1)
    upstairs = Ifc(path=flat().write(tmp_path), level="Up").load()
    assert [("Studio", 32.8)] == [
        (r.name, pytest.approx(r.area_m2, abs=0.2)) for r in upstairs.rooms
    ]
    with pytest.raises(FloorPlanError, match="its levels are: Cellar, Ground, Up"):
        Ifc(path=path, level="Roof").load()


def test_damaged_and_empty_models_are_refused(tmp_path):
    whole = flat().write(tmp_path).read_text()
    for text, reason in (
        ("hello", "no header ISO-10303-21"),
        (whole[:300], "damaged|no room and no free space|can't be read"),
        (Model({"Ground": 0.0}).file.to_string(), "no room and no free space"),
    ):
        (tmp_path / "bad.ifc").write_text(text)
        with pytest.raises(FloorPlanError, match=reason):
            load_floorplan(tmp_path / "bad.ifc")


def test_elements_without_geometry_are_noted(tmp_path):
    from ifcopenshell.api import root

    model = flat()
    root.create_entity(model.file, ifc_class="IfcWall")

    notes = load_floorplan(model.write(tmp_path)).notes

    assert "elements without a geometry, which are left out: 1" in notes


def test_text_in_another_encoding_is_no_obstacle(tmp_path):
    path = flat().write(tmp_path)
    plan = load_floorplan(path)
    path.write_bytes(
        path.read_bytes().replace(b"ISO-10303-21;\n", b"ISO-10303-21;\n/* \xe4 */\n", 1)
    )

    assert plan == load_floorplan(path)


def variation(k, folder: Path) -> tuple[Path, int, bool]:
    """A model with gaps in its walls, or doors; perhaps an open plan, and several storeys."""
    home = small_home(k, turns=(0, 90, 17))
    is_open = k % 3 == 0
    names = [f"Storey {n}" for n in range(1 + k % 4 // 2 * (1 + k % 2))]
    model = Model({n: 2.8 * i for i, n in enumerate(names)}, ("IFC4", "IFC4X3")[k % 2], home.turn)
    (_, _, x, y), (_, y1, _, top), (x1, _, right, _) = home.rooms
    t = OUTER_M
    whole = [(-t, -t, right + t, 0), (-t, top, right + t, top + t), (right, 0, right + t, top)]
    whole += [(-t, 0, 0, top), (0, y, x, y1), (x, 0, x1, top)]
    for number, storey in enumerate(names):
        walls = home.walls if k % 2 else whole
        for wall in walls:
            if not (is_open and wall[1] == y and wall[3] == y1):
                model.add("IfcWall", wall, storey=storey)
        for k_room, (room, name) in enumerate(zip(home.rooms, home.names, strict=True)):
            box = (room[0], room[1], room[2], y1) if is_open and k_room == 0 else room
            model.add("IfcSpace", box, str(k_room), storey, LongName=name)
        for kind, ((ax, ay), (bx, by)) in zip("ooi", (*home.doors, home.front), strict=True):
            half = (OUTER_M if kind == "i" else INNER_M) / 2 - 0.01
            across = ay == by
            box = (ax, ay - half, bx, by + half) if across else (ax - half, ay, bx + half, by)
            if not k % 2 and not (is_open and across):
                model.add("IfcDoor", box, storey=storey, z=(0, 2.1))
        if number + 1 < len(names):
            model.add("IfcStair", (right - 1, 0.5, right, 3.5), storey=storey, z=(0, 2.8))
    return model.write(folder), len(names), is_open


@pytest.mark.parametrize("k", VARIATIONS)
def test_models_of_any_storeys_language_and_turn_are_the_home(tmp_path, k):
    path, storeys, is_open = variation(k, tmp_path)

    plan = load_floorplan(path)

    check(plan, small_home(k), doors=1 if is_open else 2, storeys=storeys, slack=0.03)
    assert not any("there are walls" in note for note in plan.notes)


def test_a_whole_house_is_side_by_side_and_its_stairs_are_a_portal(tmp_path):
    model = flat()
    model.add("IfcStair", (5, 0.5, 6, 3.5), z=(0, 2.8))
    plan = load_floorplan(model.write(tmp_path))

    assert ["Kitchen", "Schlafzimmer", "Studio"] == [room.name for room in plan.rooms]
    assert "storeys without rooms, which are left out: Cellar" in plan.notes
    ((_, takes_us),) = [(p.type, p.takes_us) for p in plan.portals]
    assert 11.5e6 == pytest.approx(takes_us, rel=0.01)  # 16.5 treads of 17 cm in 0.7 s each


def test_an_opening_without_a_door_is_a_way_and_one_above_a_sill_is_none(tmp_path):
    ways = {}
    for z in ((0.0, 2.2), (0.9, 2.2)):
        model = Model({"Ground": 0.0})
        for wall in ((-0.2, -0.2, 8.4, 0), (-0.2, 4, 8.4, 4.2), (-0.2, 0, 0, 4), (8.2, 0, 8.4, 4)):
            model.add("IfcWall", wall)
        model.add("IfcWall", (4, 0, 4.2, 4))
        for number, box in enumerate(((0, 0, 4, 4), (4.2, 0, 8.2, 4))):
            model.add("IfcSpace", box, str(number))
        model.add("IfcOpeningElement", (3.9, 1, 4.3, 2), z=z)
        ways[z] = len(load_floorplan(model.write(tmp_path)).polygons)
        (tmp_path / "flat.ifc").unlink()

    assert {(0.0, 2.2): 1, (0.9, 2.2): 2} == ways
