import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tests.reference.chambers import nearest_labels

from fleet2d.kernels import (
    fill_from_neighbors,
    label_frames,
    spread_labels,
)


@st.composite
def labelled(draw):
    """Draw labels and a mask; some labels are outside the mask."""
    rows, columns = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    cells = st.lists(st.integers(-6, 4), min_size=rows * columns, max_size=rows * columns)
    drawn = np.array(draw(cells)).reshape(rows, columns)
    is_outside = (drawn <= -5) | (drawn == 4)
    return np.clip(drawn, -1, 3).astype(np.int32), ~is_outside


@given(labelled())
def test_labels_spread_as_growing_them_step_by_step_does(drawn):
    labels, mask = drawn

    assert np.array_equal(nearest_labels(labels, mask), spread_labels(labels, mask))


@given(labelled())
def test_frames_are_the_boxes_of_the_cells_of_each_label(drawn):
    labels, _ = drawn
    frames = label_frames(labels, 4)

    for label in range(4):
        cells = np.argwhere(labels == label)
        if len(cells):
            expected = [*cells.min(axis=0), *(cells.max(axis=0) + 1)]
            assert expected == frames[label].tolist()
        else:
            assert (frames[label, :2] > frames[label, 2:]).all()


@given(labelled())
def test_cells_without_a_label_take_the_first_that_touches_them(drawn):
    labels = np.pad(drawn[0], 1, constant_values=-1).astype(np.int16)
    around = ((0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))

    expected = labels.copy()
    for row, column in np.argwhere(labels[1:-1, 1:-1] < 0) + 1:
        near = (int(labels[row + up, column + east]) for up, east in around)
        expected[row, column] = next((label for label in near if label >= 0), -1)
    expected[[0, -1]] = expected[:, [0, -1]] = -1

    assert np.array_equal(expected[1:-1, 1:-1], fill_from_neighbors(labels)[1:-1, 1:-1])
