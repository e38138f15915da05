// Functions for the segmentation of rooms: which places see each other, which label is nearest.
#pragma once

#include "line_of_sight.hpp"

namespace fleet2d {

inline constexpr i32 NO_LABEL = -1;  // the label of a cell that has none

// Whether the two places of each pair see each other, (n,); places on a wall see nothing. `eyes`
// and `places` are lattice points (n, 2). Fastest if pairs of the same eye follow each other.
Array<bool> pairs_in_sight(const Mesh& mesh, View<const i64, 2> eyes, View<const i64, 2> places);

// The smallest box of cells around each label, (count, 4): first row, first column, last row plus
// one, last column plus one; of a label without cells, first ones beyond the last.
Array<i64, 2> label_frames(View<const i32, 2> labels, i64 count);

// Label cells without a label like a cell that touches them: first one across a side, then one
// across a corner; west before east, south before north.
Array<i16, 2> fill_from_neighbors(View<const i16, 2> labels);

// Label every cell of a mask that has no label like the nearest labelled cell, in steps across sides;
// of equally near labels, the lowest counts. NO_LABEL outside the mask and for cells that can't be
// reached from a label; labels outside the mask are ignored.
Array<i32, 2> spread_labels(View<const i32, 2> labels, View<const bool, 2> mask);

}  // namespace fleet2d
