// Poses and places measured: in which room, how long in each, and how far.
#pragma once

#include <algorithm>

#include "lattice.hpp"
#include "poses.hpp"

namespace fleet2d {

// The room of each place, (n,), by that of each cell, (rows, columns); a place outside of the map has
// the room at its nearest border. The map has one cell or more.
inline Array<i16> rooms_at(View<const i16, 2> room_of_place, View<const i64> x, View<const i64> y) {
    const i64 last_row = room_of_place.shape[0] - 1, last_column = room_of_place.shape[1] - 1;
    auto rooms = Array<i16>::empty({x.size()});
    for (i64 j = 0; j < x.size(); ++j) {
        const i64 row = std::clamp(floor_div(y[j], SUB), i64{0}, last_row);
        const i64 column = std::clamp(floor_div(x[j], SUB), i64{0}, last_column);
        rooms[j] = room_of_place(row, column);
    }
    return rooms;
}

// Add the number of poses in each room to `counts`, (rooms + 1,); the last entry is away, or in no room.
inline void count_rooms(View<const i16> rooms, View<const u8> away, View<i64> counts) {
    const i64 last = counts.size() - 1;
    for (i64 j = 0; j < rooms.size(); ++j) ++counts[away[j] != 0 || rooms[j] < 0 ? last : i64{rooms[j]}];
}

// The summed length of the moves from pose to pose [lattice units].
inline f64 sum_moves(const Poses& poses) {
    f64 total = 0;
    for (i64 j = 1; j < poses.x.size(); ++j) total += distance(poses.x[j - 1], poses.y[j - 1], poses.x[j], poses.y[j]);
    return total;
}

}  // namespace fleet2d
