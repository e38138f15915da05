// Poses as Python holds them: the named tuple `fleet2d.kernels.Poses`.
#pragma once

#include "../poses.hpp"
#include "arrays.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<Poses> = 4;

inline void check_poses(const Poses& poses) {
    const i64 steps = poses.x.size();
    require(poses.y.size() == steps && poses.heading.size() == steps && poses.away.size() == steps,
            "all arrays of poses must have one length");
}

inline void check_portals(View<const i64, 2> portals) {
    constexpr i64 farthest = i64{1} << 28;  // lattice units: products of differences stay inside 64 bits
    require(portals.shape[1] == 5 && all_in_range(portals, -farthest, farthest),
            "portals must be (x, y, x, y, reach), within 2**28 lattice units");
}

}  // namespace fleet2d
