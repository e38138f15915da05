// Checks of places on the lattice that come from Python.
#pragma once

#include "../array.hpp"
#include "arrays.hpp"

namespace fleet2d {

// Coordinates reach up to here, in both directions: products of two differences fit in 2**63.
inline constexpr i64 FARTHEST_POINT = i64{1} << 30;

inline void check_point(i64 x, i64 y) {
    require(-FARTHEST_POINT <= x && x <= FARTHEST_POINT && -FARTHEST_POINT <= y && y <= FARTHEST_POINT,
            "points must be within 2**30 lattice units");
}

inline void check_points(View<const i64, 2> points) {
    require(points.shape[1] == 2 && all_in_range(points, -FARTHEST_POINT, FARTHEST_POINT + 1),
            "points must be (n, 2), within 2**30 lattice units");
}

}  // namespace fleet2d
