import pytest

from fleet2d.floorplan.native import HOMES, bundled_names, read_bundled, read_native


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_home_is_what_the_reader_with_checks_reads(name):
    """They are read without checks: a coordinate that isn't a float would be stored as it is."""

    def parts(plan):
        regions = [(r.labels, r.shape.wkt, r.name, r.type) for r in plan.regions]
        return repr((plan.rooms, plan.doorways, plan.objects, plan.no_go, plan.entrance, regions))

    plan, checked = read_bundled(name), read_native(HOMES / f"{name}.json")

    assert plan == checked
    assert parts(plan) == parts(checked)
    assert plan.source == checked.source
