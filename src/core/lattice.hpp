// The lattice that all coordinates lie on, and the integer arithmetic of it.
#pragma once

#include <cmath>

#include "array.hpp"

namespace fleet2d {

inline constexpr i64 SUB = 64;  // lattice units per cell
inline constexpr i64 CELL_CENTRE =
    33;  // of a cell's centre from its corner: odd, so no axis-parallel wall runs through

// The largest integer that is not above a / b, b > 0.
constexpr i64 floor_div(i64 a, i64 b) {
    const i64 quotient = a / b;
    return quotient - static_cast<i64>(a % b < 0);
}

// What is left of a after floor_div, in [0, b), b > 0.
constexpr i64 floor_mod(i64 a, i64 b) {
    const i64 rest = a % b;
    return rest < 0 ? rest + b : rest;
}

// The first multiple of a period, above 0, from `step` on.
constexpr i64 next_multiple(i64 step, i64 period) { return step + floor_mod(-step, period); }

// Twice the signed area of (a, b, c): positive when c lies left of the line from a to b.
constexpr i64 orient(i64 ax, i64 ay, i64 bx, i64 by, i64 cx, i64 cy) {
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
}

// The distance of two lattice points. A square root is correctly rounded on every machine.
inline f64 distance(i64 ax, i64 ay, i64 bx, i64 by) {
    const i64 dx = bx - ax, dy = by - ay;
    return std::sqrt(static_cast<f64>(dx * dx + dy * dy));
}

}  // namespace fleet2d
