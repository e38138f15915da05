// Where a group of furniture can stand in a room.
//
// A room is a window of cells. Turned by `turn` quarters, its rows count away from one of the four walls and its
// columns along it, so that a group has its back at the bottom.
#pragma once

#include "array.hpp"

namespace fleet2d {

// How many cells of a mask are above and left of each corner of the cells, (rows + 1, columns + 1).
Array<i32, 2> corner_sums(View<const bool, 2> mask);

// The floor of a room and what surrounds it; (rows, columns) unless noted otherwise.
struct RoomFloor {
    View<const bool, 2> holds;        // cells that furniture may cover
    View<const bool, 2> whole;        // cells that no wall cuts: what must stay empty before furniture is of these
    View<const i32, 3> before_walls;  // (4, rows + 1, columns + 1) corner_sums of cells before a wall, for each turn
    View<const i64, 2> from_doors;    // squared distance from the floor before doors [cells]
};

// A group of furniture, and what its places are worth.
struct GroupRule {
    i64 width, depth;  // extent along the back, and away from it [cells]
    i64 front;         // depth of the floor before it that stays empty [cells]
    i64 backed;        // least part of its back that is before a wall [cells]
    i64 corner;        // points for a place in a corner
    i64 away;          // points for a place far from doors
    i64 far;           // distance from doors beyond which more distance earns no points [cells]
};

// Where a group can be between the cells that are occupied: (n, 4), the turn, the first row and column in the turned
// window, and the points of the place; by turn, row and column.
Array<i64, 2> group_places(const RoomFloor& floor, View<const bool, 2> occupied, const GroupRule& group);

}  // namespace fleet2d
