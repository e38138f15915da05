"""Sight in real homes, turned and mirrored, doors open and shut: the short form of the benchmark."""

import numpy as np
import pytest
from tests.scripts import script
from tests.thorough import some

import fleet2d

PLANS = {
    "houseexpo/658e5214673c7a4e25b458e56bdb6144.json": 5,
    "houseexpo/2deaa98e9acd1293d5224e25715c1393.json": 5,
    "ros_maps/aws_small_house/map.yaml": 1,
    "valetudo/roborock_s6_segments.json": 1,
}
"""With at least so many doors."""


@pytest.fixture(scope="module")
def proof():
    """The script that compares millions of pairs."""
    return script("benchmarks/sight_proof.py")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "doors"), some([*PLANS.items()], 2))
def test_sight_agrees_with_every_wall_however_a_home_lies_and_its_doors_stand(
    proof, shared_data, name, doors
):
    plan = fleet2d.load_floorplan(shared_data / name)
    wrong, (pairs, seen, arrangements) = proof.check_plan(plan, np.random.default_rng(7), 6)

    assert [0, 0, 0, 0] == wrong.tolist()
    assert doors <= len(plan.doorways)
    assert 24 == arrangements
    assert pairs > 90_000
    assert seen > 2_000
