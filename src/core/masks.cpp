#include "masks.hpp"

#include <queue>
#include <vector>

#include "grid.hpp"

namespace fleet2d {
namespace {

constexpr i32 NOWHERE = -1;  // the part, and the number of steps, of a pixel that is not reached

// Which way a side of a pixel runs, in the order of SIDES.
enum Direction : int { EAST, NORTH, WEST, SOUTH };

constexpr u8 bit(int direction) { return static_cast<u8>(1 << direction); }

// The border sides of a mask that start at each corner of the pixels, one bit for each direction,
// (rows + 1, columns + 1). Sides run with the mask on their left.
Array<u8, 2> border_sides(View<const bool, 2> mask) {
    const auto [rows, columns] = mask.shape;
    auto result = Array<u8, 2>::zeros({rows + 1, columns + 1});
    const View<u8, 2> sides = result;
    for (i64 row = 0; row < rows; ++row) {
        for (i64 column = 0; column < columns; ++column) {
            if (!mask(row, column)) continue;
            if (row == 0 || !mask(row - 1, column)) sides(row, column) |= bit(EAST);
            if (column == columns - 1 || !mask(row, column + 1)) sides(row, column + 1) |= bit(NORTH);
            if (row == rows - 1 || !mask(row + 1, column)) sides(row + 1, column + 1) |= bit(WEST);
            if (column == 0 || !mask(row, column - 1)) sides(row + 1, column) |= bit(SOUTH);
        }
    }
    return result;
}

// Append the corners of the ring that starts with the side to the east of `corner`, and remove its
// sides; returns the new number of corners.
i64 follow_ring(View<u8, 2> sides, GridCell corner, Array<i32, 2>& corners, i64 count) {
    const i64 first_row = corner.row, first_column = corner.column;
    int direction = EAST, before = SOUTH;  // any but EAST: the ring bends where it starts
    do {
        if (direction != before) {
            corners.grow(count + 1, count);
            corners(count, 0) = static_cast<i32>(corner.column);
            corners(count, 1) = static_cast<i32>(corner.row);
            ++count;
        }
        before = direction;
        corner = corner + SIDES[static_cast<std::size_t>(direction)];
        direction = (before + 3) % 4;  // right first, then straight on, then left
        while ((at(sides, corner) & bit(direction)) == 0) direction = (direction + 1) % 4;
        at(sides, corner) ^= bit(direction);  // its first side is the last one to go
    } while (corner.row != first_row || corner.column != first_column || direction != EAST);
    return count;
}

}  // namespace

Array<i32, 2> label_parts(View<const bool, 2> mask, bool diagonal) {
    const auto [rows, columns] = mask.shape;
    auto result = Array<i32, 2>::filled(mask.shape, NOWHERE);
    const View<i32, 2> part = result;
    std::vector<GridCell> stack;
    i32 parts = 0;
    const auto reach = [&](GridCell pixel) {
        if (is_inside(mask.shape, pixel) && at(mask, pixel) && at(part, pixel) == NOWHERE) {
            at(part, pixel) = parts;
            stack.push_back(pixel);
        }
    };
    for (i64 row = 0; row < rows; ++row) {
        for (i64 column = 0; column < columns; ++column) {
            reach({row, column});
            if (stack.empty()) continue;
            while (!stack.empty()) {
                const GridCell pixel = stack.back();
                stack.pop_back();
                for (const GridCell step : SIDES) reach(pixel + step);
                if (!diagonal) continue;
                for (const GridCell step : CORNERS) reach(pixel + step);
            }
            ++parts;
        }
    }
    return result;
}

Array<i32, 2> count_steps(View<const bool, 2> start, View<const bool, 2> mask) {
    const auto [rows, columns] = mask.shape;
    auto result = Array<i32, 2>::filled(mask.shape, NOWHERE);
    const View<i32, 2> steps = result;
    std::queue<GridCell> waiting;
    const auto reach = [&](GridCell pixel, i32 step) {
        if (is_inside(mask.shape, pixel) && at(mask, pixel) && at(steps, pixel) == NOWHERE) {
            at(steps, pixel) = step;
            waiting.push(pixel);
        }
    };
    for (i64 row = 0; row < rows; ++row) {
        for (i64 column = 0; column < columns; ++column) {
            if (start(row, column)) reach({row, column}, 0);
        }
    }
    while (!waiting.empty()) {
        const GridCell pixel = waiting.front();
        waiting.pop();
        for (const GridCell side : SIDES) reach(pixel + side, at(steps, pixel) + 1);
    }
    return result;
}

Rings trace_rings(View<const bool, 2> mask) {
    auto result = border_sides(mask);
    const View<u8, 2> sides = result;
    Rings rings{Array<i32, 2>::empty({64, 2}), Array<i64>::zeros({64})};
    i64 corners = 0, count = 0;
    for (i64 row = 0; row < sides.shape[0]; ++row) {
        for (i64 column = 0; column < sides.shape[1]; ++column) {
            // The first side of a ring that a scan by rows meets runs east, and starts at a corner.
            if ((sides(row, column) & bit(EAST)) == 0) continue;
            corners = follow_ring(sides, {row, column}, rings.corners, corners);
            ++count;
            rings.start.grow(count + 1, count);
            rings.start[count] = corners;
        }
    }
    rings.corners.truncate(corners);
    rings.start.truncate(count + 1);
    return rings;
}

}  // namespace fleet2d
