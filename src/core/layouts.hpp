// Rooms as rectangles: how a synthetic home's rooms lie in a rectangle that is cut into parts, and in the strips along
// a corridor.
//
// Lengths are units of 5 cm, areas their squares. A box is a room and its sides: (room, x0, y0, x1, y1). Sums of
// floats are exact before they are rounded, as those of Python's fsum, and what has no place is an empty array.
#pragma once

#include "array.hpp"

namespace fleet2d {

constexpr i64 INNER_WALL = 2;       // its thickness
constexpr i64 DEEPEST_STRIP = 240;  // no strip of rooms is deeper

// Rectangles cut into rooms: trees whose nodes stand in preorder, (nodes, 2). A leaf is (room, percent of its area), a
// cut (-1 if its parts lie along y, -2 if along x; their number). `starts` has the first node of each tree.
struct Divisions {
    View<const i64, 2> nodes;
    View<const i64> starts;
};

// The boxes (n, 5) of the tree that makes rooms squarest in `sides` (x0, y0, x1, y1), the first if tied. A wall should
// not end at any of the `mouths` (n, 4) of corridors.
Array<i64, 2> squarest_rooms(const Divisions& trees, View<const f64> areas, View<const i64> sides,
                             View<const i64, 2> mouths);

// A corridor along a strip of rooms.
struct CorridorRule {
    i64 hall;    // index of the hallway
    i64 width;   // its gross width
    i64 suite;   // whether the last room of the strip ends the corridor, and is as much deeper: 1 or 0
    i64 closet;  // a small room at the end of the corridor, or -1
};

// Whether boxes (n, 5) could be rooms at another scale. `limits` (rooms, 2) have the least shorter side of each room,
// and the largest ratio of its sides.
bool is_promising(View<const i64, 2> boxes, View<const f64, 2> limits);

// The rooms of a strip along x, from 0 to `length`, with their front at y = 0. `slots` (n, 3) have a room, another one
// behind it or -1, and how much deeper than the strip they are. Empty if it isn't at least as deep as `least` and at
// most as `most` there.
Array<i64, 2> strip_rooms(View<const i64, 2> slots, View<const f64> areas, i64 length, i64 least, i64 most);

// The same above a corridor from y = 0 on.
Array<i64, 2> row_rooms(View<const i64, 2> slots, View<const f64> areas, const CorridorRule& corridor, i64 length,
                        i64 least, i64 most);

// The rooms of a wing: a strip below its corridor, and one above it that has a depth; and the depth of the one below.
struct WingRooms {
    Array<i64, 2> boxes;
    i64 depth = 0;
};
WingRooms wing_rooms(View<const i64, 2> front, View<const i64, 2> back, View<const f64> areas,
                     const CorridorRule& corridor, i64 back_depth, i64 least, i64 most);

// Which of some depths of the strip above makes the rooms of a wing squarest, the first if tied; -1 if none is
// promising.
i64 squarest_depth(View<const i64, 2> front, View<const i64, 2> back, View<const f64> areas,
                   const CorridorRule& corridor, View<const i64> depths, i64 least, i64 most,
                   View<const f64, 2> limits);

}  // namespace fleet2d
