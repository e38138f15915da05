// Headings as integers: 4096 to a turn, counter-clockwise from +x, with one table of sines.
//
// Angles never meet a sine or an arc tangent at run time: those differ in the last bit between
// machines. The table is made by the compiler and pinned by a test's digest.
#pragma once

#include <array>

#include "array.hpp"

namespace fleet2d {

inline constexpr i64 TURN = 4096;  // headings per turn
inline constexpr i64 HALF_TURN = TURN / 2;
inline constexpr i64 QUARTER = TURN / 4;
inline constexpr i64 UNIT = i64{1} << 30;  // length of a direction vector

// Sines of a quarter turn at half-heading resolution, times UNIT: entry i is the angle i * 2 pi / 8192.
inline constexpr auto SINES = [] {
    std::array<i64, 2 * QUARTER + 1> table{};
    for (i64 i = 0; i <= 2 * QUARTER; ++i) {
        const f64 angle = static_cast<f64>(i) * (2 * 3.14159265358979323846 / (2 * TURN));
        f64 term = angle, sum = 0;
        for (int k = 1; k < 30; k += 2) {  // the series of the sine, which ends below 2**-60
            sum += term;
            term *= -angle * angle / ((k + 1) * (k + 2));
        }
        table[static_cast<std::size_t>(i)] = static_cast<i64>(sum * static_cast<f64>(UNIT) + 0.5);
    }
    return table;
}();

// UNIT * sine of `half` / 8192 of a turn.
constexpr i64 half_sine(i64 half) {
    i64 h = half & (2 * TURN - 1);
    const bool negative = h >= TURN;
    if (negative) h -= TURN;
    const i64 value = SINES[static_cast<std::size_t>(h <= 2 * QUARTER ? h : TURN - h)];
    return negative ? -value : value;
}

// UNIT * sine of a heading (any integer).
constexpr i64 sine(i64 heading) { return half_sine(2 * heading); }

// UNIT * cosine of a heading (any integer).
constexpr i64 cosine(i64 heading) { return half_sine(2 * (heading + QUARTER)); }

// The heading nearest to the vector (dx, dy) [lattice units]; 0 for a null vector.
constexpr i64 heading_of(i64 dx, i64 dy) {
    i64 turned = 0;
    while (!(dx > 0 && dy >= 0)) {  // into the first quadrant, half open
        if (dx == 0 && dy == 0) return 0;
        const i64 before = dx;
        dx = dy;
        dy = -before;
        turned += QUARTER;
    }
    i64 low = 0, high = QUARTER;  // the answer is `low` once no half-way direction lies between
    while (low < high) {
        const i64 middle = (low + high) >> 1;
        const i64 half_way = 2 * middle + 1;
        if (half_sine(half_way + 2 * QUARTER) * dy - half_sine(half_way) * dx >= 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return (turned + low) & (TURN - 1);
}

// The shorter signed turn from `start` to `end`, in [-2048, 2047].
constexpr i64 turn_between(i64 start, i64 end) { return ((end - start + HALF_TURN) & (TURN - 1)) - HALF_TURN; }

}  // namespace fleet2d
