"""Distances between storeys: what lies side by side in the plan isn't near."""

import json

from tests.two_storeys import PLAN

import fleet2d


def verdicts(tmp_path, *, stairs=True, house=PLAN, **expected):
    """Return when what is expected of a minute is violated.

    Ana stands above, and from second 30 on below; luna above, astro below.
    """
    path = tmp_path / "house.json"
    plan = house if stairs else {key: PLAN[key] for key in PLAN if key != "portals"}
    path.write_text(json.dumps(plan))
    robot = {"behaviors": []}
    run = fleet2d.run(
        {
            "simulation": {"duration": "1 min"},
            "floorplan": {"type": "native", "path": str(path)},
            "users": {"ana": {"type": "live", "start": [6.5, 2.0]}},
            "robots": {
                "astro": robot | {"start": [4.5, 2.0]},
                "luna": robot | {"start": [10.5, 2.0]},
            },
            "script": [{"at": "30 s", "put": "ana", "to": [3.5, 2.0]}],
            "expect": expected,
        }
    )
    found = {name: [] for name in expected}
    for row in run.tables["violations"].to_pylist():
        found[row["expectation"]].append((row["step"], row["last_step"]))
    return found


def test_bodies_and_places_of_two_storeys_are_far_apart(tmp_path):
    found = verdicts(
        tmp_path,
        body="never(distance(astro, ana) < 3 m)",
        room="never(distance(astro, above) < 3 m)",
        point="never(distance(astro, (6.5, 2)) < 3 m)",
        sofa="never(distance(ana, sofa) < 3 m)",
    )

    assert found == {"body": [(30, 59)], "room": [], "point": [], "sofa": [(30, 59)]}


def test_a_place_of_the_same_storey_is_as_far_as_ever(tmp_path):
    found = verdicts(
        tmp_path,
        room="always(distance(luna, above) == 0)",
        point="always(distance(astro, (1.5, 2)) == 3 m)",
        kinds="eventually(distance(ana, sofa) < 1.5 m)",
    )

    assert found == {"room": [], "point": [], "kinds": []}


def test_the_nearest_is_on_the_same_storey(tmp_path):
    found = verdicts(
        tmp_path,
        above="always(implies(room(ana) == above, nearest(ana) == luna))",
        below="always(implies(room(ana) == below, nearest(ana) == astro))",
    )

    assert found == {"above": [], "below": []}


def test_without_portals_the_plan_is_one_storey(tmp_path):
    found = verdicts(tmp_path, stairs=False, body="never(distance(astro, ana) < 3 m)")

    assert found == {"body": [(0, 59)]}


def test_a_garage_that_nothing_joins_is_on_the_storey_beside_it(tmp_path):
    corners = [[0, -4], [5, -4], [5, -0.3], [0, -0.3]]
    garage = {"name": "garage", "type": "garage", "polygon": corners}
    house = {**PLAN, "free": [*PLAN["free"], corners], "rooms": [*PLAN["rooms"], garage]}

    found = verdicts(
        tmp_path,
        house=house,
        near="always(distance(astro, garage) < 3 m)",
        far="never(distance(luna, garage) < 30 m)",
    )

    assert found == {"near": [], "far": []}
