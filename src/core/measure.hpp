// Measurements of poses: rooms, time spent together, and distances covered.
#pragma once

#include <algorithm>
#include <initializer_list>

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

// At how many of `steps` steps two bodies are in the same room. Each has the steps at which its visits begin, the first
// of them 0, ascending, and the room of each visit, below 0 for none.
inline i64 count_together(View<const i64> begin, View<const i16> room, View<const i64> other_begin,
                          View<const i16> other_room, i64 steps) {
    i64 count = 0, now = 0;
    for (i64 i = 0, j = 0; now < steps;) {
        const i64 end = i + 1 < begin.size() ? begin[i + 1] : steps;
        const i64 other_end = j + 1 < other_begin.size() ? other_begin[j + 1] : steps;
        const i64 until = std::min(end, other_end);
        if (room[i] >= 0 && room[i] == other_room[j]) count += until - now;
        if (end == until) ++i;
        if (other_end == until) ++j;
        now = until;
    }
    return count;
}

// The length of a move of `length` that may lead through a portal, which has no length itself [lattice units]. Each row
// of `portals` has the ends (x, y) and (x, y) of one, and how far from them bodies stand.
inline f64 without_portal(f64 length, i64 x, i64 y, i64 to_x, i64 to_y, View<const i64, 2> portals) {
    for (i64 p = 0; p < portals.shape[0]; ++p) {
        for (const i64 one : {0, 2}) {
            const i64 near_x = portals(p, one), near_y = portals(p, one + 1);
            const i64 far_x = portals(p, 2 - one), far_y = portals(p, 3 - one);
            const f64 in = distance(x, y, near_x, near_y), out = distance(far_x, far_y, to_x, to_y);
            if (in >= distance(x, y, far_x, far_y) || out >= distance(near_x, near_y, to_x, to_y)) continue;
            const f64 reach = static_cast<f64>(portals(p, 4));
            length = std::min(length, std::max(in - reach, 0.0) + std::max(out - reach, 0.0));
        }
    }
    return length;
}

// The summed length of the moves from pose to pose [lattice units], with portals as above.
inline f64 sum_moves(const Poses& poses, View<const i64, 2> portals) {
    f64 total = 0;
    for (i64 j = 1; j < poses.x.size(); ++j) {
        const i64 x = poses.x[j - 1], y = poses.y[j - 1], to_x = poses.x[j], to_y = poses.y[j];
        total += without_portal(distance(x, y, to_x, to_y), x, y, to_x, to_y, portals);
    }
    return total;
}

}  // namespace fleet2d
