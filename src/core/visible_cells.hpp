// The cells that a camera sees: those whose centre is in range, in its angle, and in sight.
//
// The visible region of the camera's exact place is filled row by row, piece by piece. Each border of a piece and
// each border of the camera's angle is a line that is followed from row to row by integer steps with a remainder
// (as Bresenham does), so a cell is in view exactly when a line of sight to its centre says so, and nothing is
// divided in the inner loop.
#pragma once

#include <vector>

#include "lens.hpp"
#include "region.hpp"

namespace fleet2d {

// How far and how wide a camera sees.
struct Reach {
    i64 near_squared;  // lattice units squared, below 2**52
    i64 far_squared;   // the same
    i64 half_angle;    // 1/8192 of a turn; 4096 and more is all round
};

// The points (dx, dy) with a dx + b dy >= bound.
struct HalfPlane {
    i64 a, b;
    i64 bound = 0;
};

// The half plane to the left of a direction [1/8192 turn], and on it.
constexpr HalfPlane left_of(i64 half) { return {-half_sine(half), half_sine(half + 2 * QUARTER)}; }

// Neighbouring cells of one row.
struct Span {
    i32 row;
    i32 first, last;  // columns
};

// Finds the cells that cameras see, in one grid. Create one for each thread and mesh.
class CellFinder {
public:
    CellFinder(const Mesh& mesh, i64 rows, i64 columns);

    // The cells in view of a camera, none twice, in no particular order; kept until the next call. None for a
    // camera outside or on a wall.
    const std::vector<Span>& cells_in_view(Pose camera, const Reach& reach);

private:
    Mesh mesh_;
    i64 rows_, columns_;
    Lookout lookout_;
    Array<i64> low_, high_;   // (rows,) the first and the last column within range and angle
    std::vector<Span> open_;  // (rows,) empty between calls
    std::vector<Span> spans_;
};

}  // namespace fleet2d
