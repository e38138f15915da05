import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from tests.reference.chambers import nearest_labels

from fleet2d.floorplan.mesh import build_mesh
from fleet2d.kernels.chambers import see_each, spread_labels
from fleet2d.kernels.mesh import locate
from fleet2d.kernels.sight import line_of_sight


@st.composite
def labelled(draw: st.DrawFn) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    rows, columns = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    cells = st.lists(st.integers(-6, 3), min_size=rows * columns, max_size=rows * columns)
    drawn = np.array(draw(cells)).reshape(rows, columns)
    return np.maximum(drawn, -1).astype(np.int32), drawn > -5


@given(labelled())
def test_labels_spread_as_growing_them_step_by_step_does(
    drawn: tuple[NDArray[np.int32], NDArray[np.bool_]],
) -> None:
    labels, mask = drawn

    assert np.array_equal(nearest_labels(labels, mask), spread_labels(labels, mask))


def test_pairs_see_each_other_as_one_by_one() -> None:
    mesh = build_mesh([shapely.box(0, 0, 640, 640) - shapely.box(256, 0, 320, 512)], 10, 10)
    rng = np.random.default_rng(3)
    eyes, places = rng.integers(-20, 660, (2, 300, 2))

    expected = [
        line_of_sight(mesh, *eye, locate(mesh, *eye), *place)
        for eye, place in zip(eyes.tolist(), places.tolist(), strict=True)
    ]

    assert expected == see_each(mesh, eyes, places).tolist()
