// Poses of a body over consecutive steps, as kernels read them.
#pragma once

#include "array.hpp"

namespace fleet2d {

// All arrays have one entry for each step.
struct Poses {
    View<const i64> x;        // lattice units
    View<const i64> y;        // lattice units
    View<const i64> heading;  // 1/4096 turn
    View<const u8> away;      // 1 = not at home
};

}  // namespace fleet2d
