"""`scale` multiplies the lengths of every source, and sizes that are no home's propose it."""

import numpy as np
import pytest
import shapely
from tests.homes.test_damaged_files import FORMATS, PGM, write

from fleet2d.configuration.components import lookup
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.checkup import checkup
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.homes.synthetic.source import Synthetic


def of_type(plan, kind):
    """Return the objects of a type."""
    return [thing for thing in plan.objects if thing.type == kind]


@pytest.mark.parametrize("kind", sorted({name.split()[0] for name in FORMATS}))
def test_scale_multiplies_lengths_of_every_format(kind, tmp_path):
    name, content, _ = FORMATS[kind]
    path = write(tmp_path, name, content)
    (tmp_path / "map.pgm").write_bytes(PGM)

    def read(cell, scale):
        source = lookup("floorplan", kind).model_validate(
            {"path": path, "cell": cell, "scale": scale}
        )
        assert isinstance(source, FloorPlanSource)
        return source.plan()

    usual, doubled = read(0.05, None), read(0.1, 2.0)

    assert doubled.area_m2 == pytest.approx(4 * usual.area_m2, rel=0.15)
    assert np.allclose(np.array(usual.bounds) * 2, doubled.bounds, atol=0.3)


def test_scale_multiplies_everything_in_a_home():
    usual, doubled = load_floorplan(cell=0.05), load_floorplan(cell=0.1, scale=2)
    bed, large_bed = of_type(usual, "bed")[0], of_type(doubled, "bed")[0]

    assert usual.room_of_cell.tolist() == doubled.room_of_cell.tolist()
    assert [2 * door.width_m for door in usual.doorways] == pytest.approx(
        [door.width_m for door in doubled.doorways]
    )
    assert shapely.get_coordinates(large_bed.footprint) == pytest.approx(
        2 * shapely.get_coordinates(bed.footprint)
    )
    assert large_bed.uses[0].x == 2 * bed.uses[0].x
    assert doubled.entrance == tuple(2 * value for value in usual.entrance or ())


@pytest.mark.parametrize("scale", [10.0, 39.37, 100.0, 1000.0, 0.1])
def test_home_in_another_unit_is_told_with_the_line_to_type(scale):
    try:
        plan = Synthetic(seed=3, cell=min(0.05 * max(scale, 1), 1), scale=scale).plan()
        text = next(f.text for f in checkup(plan) if f.kind == "scale")
    except FloorPlanError as error:
        text = str(error)

    assert f"floorplan.scale={1 / scale:.3g}" in text


def test_unit_is_told_by_the_width_of_doors():
    in_feet = Synthetic(seed=3, scale=3.28084).plan()
    (finding,) = [f for f in checkup(in_feet) if f.kind == "scale"]

    assert "wrong" == finding.severity
    assert "doors the plan is in feet: floorplan.scale=0.3048" in finding.text


@pytest.mark.parametrize("seed", range(3))
def test_home_in_metres_has_no_finding_on_its_scale(seed):
    assert [] == [f for f in checkup(Synthetic(seed=seed).plan()) if f.kind == "scale"]
