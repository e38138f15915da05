// Lenses as Python holds them: the named tuple `fleet2d.kernels.Lenses`.
#pragma once

#include "../lens.hpp"
#include "arrays.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<Lenses> = 18;

// All arrays must be of one set of cameras (and users).
inline void check_lenses(const Lenses& lenses) {
    const i64 cameras = lenses.near_squared.size();
    for (const auto& values :
         {lenses.far_squared, lenses.half_angle, lenses.chance, lenses.moves, lenses.forward, lenses.left,
          lenses.heading, lenses.pan_count, lenses.pan_us, lenses.period, lenses.latency, lenses.errs, lenses.points}) {
        require(values.size() == cameras, "all arrays of lenses must have one length, that of the cameras");
    }
    require(lenses.pans.size() == cameras && lenses.bodies.size() == cameras && lenses.reach.size() == cameras &&
                lenses.widest.size() == cameras,
            "all arrays of lenses must have one length, that of the cameras");
    const i64 users = lenses.bodies.shape[1];
    require(lenses.reach.shape[1] == users && lenses.widest.shape[1] == users && lenses.bodies.shape[3] == 2,
            "bodies must be (cameras, users, points, 2), reach and widest (cameras, users)");
    require(all_in_range(lenses.pan_count, 0, lenses.pans.shape[1] + 1), "pan_count must be at most that of pans");
    require(all_in_range(lenses.points, 0, lenses.bodies.shape[2]), "points must be below that of bodies");
    require(all_in_range(lenses.period, 1, INT64_MAX), "period must be 1 or more");
    require(all_in_range(lenses.near_squared, 0, i64{1} << 52) && all_in_range(lenses.far_squared, 0, i64{1} << 52),
            "near_squared and far_squared must be in 0 to 2**52 - 1");
    for (i64 i = 0; i < cameras; ++i) {
        require(lenses.pan_count[i] == 0 || lenses.pan_us[i] > 0, "pan_us must be above 0 where a camera pans");
    }
}

}  // namespace fleet2d
