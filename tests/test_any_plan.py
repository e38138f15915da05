"""Any plan can be put under the bundled scenario."""

import pytest
from tests.meshed_homes import plan_files
from tests.thorough import some

import fleet2d


@pytest.mark.slow
def test_every_houseexpo_plan_is_lived_in_for_a_day(shared_data):
    plans = plan_files(shared_data)
    for plan in plans:
        overrides = (
            "floorplan.type=houseexpo",
            f"floorplan.path={plan}",
            "simulation.duration=1 d",
        )
        run = fleet2d.run("bundled:paper", *overrides)
        shares = run.metrics["room_share"]["ana"]
        assert sum(shares.values()) == pytest.approx(1)
        assert 0.3 < shares["away"] < 0.5, plan.name  # it is a working day
        assert run.metrics["distance"]["ana"] > 1, plan.name


@pytest.mark.slow
def test_every_map_of_a_robot_is_lived_in_for_a_day(shared_data):
    maps = [
        *(("ros", path) for path in sorted((shared_data / "ros_maps").glob("*/map.yaml"))),
        *(("valetudo", path) for path in sorted((shared_data / "valetudo").glob("*.json"))),
    ]
    assert 6 == len(maps)
    for kind, path in some(maps, 2):
        overrides = (
            f"floorplan.type={kind}", f"floorplan.path={path}", "simulation.duration=1 d",
        )  # fmt: skip
        run = fleet2d.run("bundled:paper", *overrides)
        shares = run.metrics["room_share"]["ana"]
        assert sum(shares.values()) == pytest.approx(1)
        assert len(shares) >= 2, path
        assert run.metrics["distance"]["ana"] > 1, path
        assert run.metrics["distance"]["astro"] > 10 or len(run.plan.rooms) == 1, path


@pytest.mark.parametrize(("seed", "area"), some([(5, 110), (11, 30), (12, 60), (13, 150)], 2))
def test_a_furnished_synthetic_home_is_lived_in_for_a_day(seed, area):
    """In the first one a chair stands in a gap that its sitter fits into, but can't walk out of."""
    floorplan = {"type": "synthetic", "seed": seed, "area_m2": area, "furnish": True}
    personas = {"ana": "night_shift", "ben": "works_outside"}
    users = {name: {"type": "routine", "persona": kind} for name, kind in personas.items()}
    simulation = {"duration": "1 d", "start": "2026-01-05", "seed": seed}
    content = {
        "extends": "bundled:paper",
        "simulation": simulation,
        "floorplan": floorplan,
        "users": users,
        "artifacts": {"trajectories": "off"},
    }
    run = fleet2d.run(content)
    assert run.metrics["distance"]["ana"] > 1
    assert run.metrics["distance"]["astro"] > 10
