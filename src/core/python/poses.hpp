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

}  // namespace fleet2d
