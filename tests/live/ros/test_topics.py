"""Topics of ROS: what each says, against what the run stores."""

import pytest


def test_a_scan_measures_the_walls_around():
    import numpy as np
    import shapely
    from tests.live.scenes import place

    import fleet2d
    from fleet2d.live.ros.topics import BEAMS, scan_of

    plan = fleet2d.load_floorplan()
    x, y = plan.lattice.point_at(place())
    for heading in (0.0, 1.0, -2.5):
        ranges = scan_of(plan.mesh, x, y, heading) / plan.lattice.units_per_m

        x_m, y_m = plan.lattice.xy_of(x, y)
        walls = plan.free_space.boundary
        for beam in range(0, BEAMS, 7):
            angle = heading - np.pi + 2 * np.pi / BEAMS * beam
            far = (x_m + 50 * np.cos(angle), y_m + 50 * np.sin(angle))
            line = shapely.LineString([(x_m, y_m), far])
            expected = shapely.Point(x_m, y_m).distance(line.intersection(walls))
            assert ranges[beam] == pytest.approx(expected, abs=0.02)
