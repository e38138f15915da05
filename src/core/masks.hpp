// Masks of pixels: their connected parts, distances within them, and the rings around them.
//
// Pixels outside an array count as not in the mask.
#pragma once

#include "array.hpp"

namespace fleet2d {

// Number the connected parts of a mask in the order of their first pixels, row by row; the part of
// each pixel, (rows, columns), -1 outside the mask. `diagonal`: pixels that share only a corner are
// connected.
Array<i32, 2> label_parts(View<const bool, 2> mask, bool diagonal);

// Count the steps from pixel to pixel across sides, inside a mask, from the nearest start, (rows,
// columns): 0 at the start, -1 for unreachable pixels. Pixels of `start` outside the mask are ignored.
Array<i32, 2> count_steps(View<const bool, 2> start, View<const bool, 2> mask);

// Closed rings along the sides of pixels.
struct Rings {
    Array<i32, 2> corners;  // (n, 2) of all rings: x (columns) and y (rows)
    Array<i64> start;       // (rings + 1,) where the corners of each ring begin
};

// The rings between a mask and the pixels that are not in it.
//
// Rings have the mask on their left: outer ones run counter-clockwise, holes clockwise. Where two
// pixels of the mask share only a corner, a ring turns right, so each ring round one part
// (connected across sides) passes a point at most once.
Rings trace_rings(View<const bool, 2> mask);

}  // namespace fleet2d
