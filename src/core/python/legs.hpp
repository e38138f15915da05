// The ends of plans as Python holds them.
#pragma once

#include "../legs.hpp"
#include "arrays.hpp"

namespace fleet2d {

inline constexpr i64 FARTHEST_POSE = i64{1} << 29;  // coordinates and headings: their squares fit in 64 bits
using MomentRow = std::tuple<i64, i64, i64, i64, i64>;

inline Moment checked(i64 time, i64 x, i64 y, i64 heading, i64 away) {
    require(-LATEST <= time && time <= LATEST, "time must be at most 2**61 us");
    for (const i64 number : {x, y, heading})
        require(-FARTHEST_POSE < number && number < FARTHEST_POSE, "a pose must be within 2**29 of 0");
    require(away == 0 || away == 1, "away must be 0 or 1");
    return {time, x, y, heading, away};
}

inline void check_rates(f64 speed, f64 turn_rate) {
    require(speed > 0 && turn_rate > 0, "speed and turn_rate must be above 0");
}

inline MomentRow plain(const Moment& now) { return {now.time, now.x, now.y, now.heading, now.away}; }

}  // namespace fleet2d
