#include "../chambers.hpp"

#include "arrays.hpp"
#include "line_of_sight.hpp"
#include "mesh.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_chambers(nb::module_& m) {
    m.def(
        "pairs_in_sight",
        [](const Mesh& mesh, View<const i64, 2> eyes, View<const i64, 2> places) {
            check_points(eyes);
            check_points(places);
            require(eyes.size() == places.size(), "there must be as many places as eyes");
            return pairs_in_sight(mesh, eyes, places);
        },
        "mesh"_a, "eyes"_a, "places"_a, Unlocked(),
        R"(Return for each pair whether the two see each other; places on a wall see nothing.

Fastest if pairs of the same eye follow each other.

Args:
    mesh: Free space.
    eyes: int64 (n, 2), lattice points.
    places: int64 (n, 2), lattice points, one for each eye.

Returns:
    bool (n,).)");
    m.def(
        "label_frames",
        [](View<const i32, 2> labels, i64 count) {
            require(0 <= count && count <= i64{1} << 31, "count must be in 0 to 2**31");
            require(all_in_range(labels, NO_LABEL, count), "labels must be in -1 to count - 1");
            return label_frames(labels, count);
        },
        "labels"_a, "count"_a, Unlocked(), R"(Return the smallest box of cells around each label.

Args:
    labels: int32 (rows, columns), below `count`, -1 for none.
    count: Number of labels.

Returns:
    First row, first column, last row and last column, plus one, int64 (count, 4); of a label
    without cells first ones beyond the last.)");
    m.def("fill_from_neighbors", &fill_from_neighbors, "labels"_a, Unlocked(),
          R"(Label cells without a label like a cell that touches them.

First of one across a side, then of one across a corner; west before east, south before north.

Args:
    labels: int16 (rows, columns), -1 for none.

Returns:
    Labels, int16 (rows, columns).)");
    m.def(
        "spread_labels",
        [](View<const i32, 2> labels, View<const bool, 2> mask) {
            require(labels.shape == mask.shape, "labels and mask must have one shape");
            return spread_labels(labels, mask);
        },
        "labels"_a, "mask"_a, Unlocked(),
        R"(Label every cell of a mask that has no label like the nearest labelled cell, in steps across sides.

Of equally near labels, the lowest counts.

Args:
    labels: int32 (rows, columns), -1 for none; labels outside the mask are ignored.
    mask: Where labels may spread, bool (rows, columns).

Returns:
    Labels, int32 (rows, columns); -1 outside the mask and for cells that can't be reached from a label.)");
}

}  // namespace fleet2d
