// Outlines of free space whose walls are parallel to the axes, shrunk by an octagon wall by wall.
#pragma once

#include "array.hpp"

namespace fleet2d {

// The outline (n, 2) whose walls are moved to their left, where the free space is, by `reach`. Where it turns right the
// octagon goes round the corner: its straight sides are twice `half` long. Empty if a wall is slanted, or if one but a
// step that the octagon hides would vanish: then other shapes decide what is left.
Array<i64, 2> move_walls(View<const i64, 2> ring, i64 reach, i64 half);

}  // namespace fleet2d
