// Obstacles to a body, grown by its octagon, and whether further ones cut off a part of its space.
//
// Obstacles that touch each other bar the way between them. A further one leaves all ways as they are, or leaves
// others round it, unless it touches obstacles that are connected at several places, as a board between two walls.
#pragma once

#include <utility>

#include "array.hpp"

namespace fleet2d {

// Columns of a table of obstacles: the least x, y, x + y and x - y, the greatest ones, a number that obstacles have in
// common that touch each other, also through others, and whether the wall is slanted.
constexpr i64 OBSTACLE_COLUMNS = 10;

// The walls between consecutive corners (n, 2) of the same ring, grown by an octagon whose straight sides are twice
// `half` long and `reach` away from its middle. Slanted ones take all that they take at most.
Array<i64, 2> wall_obstacles(View<const i64, 2> corners, View<const i64> ring_of, i64 reach, i64 half);

// The obstacles and further rectangles, (n, 4) of least and greatest x and y, that are grown likewise; and how often
// these may cut a part of the space in two: 0 only if they certainly don't, other than into what they cover whole.
std::pair<Array<i64, 2>, i64> add_obstacles(View<const i64, 2> obstacles, View<const i64, 2> boxes, i64 reach,
                                            i64 half);

}  // namespace fleet2d
