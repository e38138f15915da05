// What a camera sees, as Python holds it: the named tuple `fleet2d.kernels.Reach`.
#pragma once

#include "../visible_cells.hpp"
#include "arrays.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<Reach> = 3;

inline void check_reach(const Reach& reach) {
    constexpr i64 limit = i64{1} << 52;
    require(
        0 <= reach.near_squared && reach.near_squared < limit && 0 <= reach.far_squared && reach.far_squared < limit,
        "near_squared and far_squared must be in 0 to 2**52 - 1");
    require(reach.half_angle >= 0, "half_angle must be 0 or more");
}

}  // namespace fleet2d
