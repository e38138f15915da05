// What the search for rooms asks often: which places see each other, which label is nearest.
#pragma once

#include "sight.hpp"

namespace fleet2d {

inline constexpr i32 NO_LABEL = -1;  // the label of a cell that has none

// Whether the two places of each pair see each other, (n,); what is on a wall sees nothing. `eyes`
// and `places` are lattice points (n, 2). Fastest if pairs of the same eye follow each other.
Array<bool> see_each(const Mesh& mesh, View<const i64, 2> eyes, View<const i64, 2> places);

// The smallest box of cells around each label, (count, 4): first row, first column, last row plus
// one, last column plus one; of a label without cells, first ones beyond the last.
Array<i64, 2> label_frames(View<const i32, 2> labels, i64 count);

// Give cells without a label that of a cell that touches them: first of one across a side, then of
// one across a corner; west before east, south before north.
Array<i16, 2> fill_beside(View<const i16, 2> labels);

// Give every cell of a mask that has no label the nearest one, in steps across sides. Of labels
// that are equally near the lowest is taken. NO_LABEL outside the mask and where no way leads from
// a label; labels outside the mask count for nothing.
Array<i32, 2> spread_labels(View<const i32, 2> labels, View<const bool, 2> mask);

}  // namespace fleet2d
