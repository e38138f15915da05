// Grids of cells: rows and columns, and the cells beside one.
#pragma once

#include <algorithm>
#include <array>
#include <queue>

#include "array.hpp"

namespace fleet2d {

// A cell of a grid, or the step from one to another.
struct GridCell {
    i64 row, column;

    constexpr bool operator==(const GridCell&) const = default;
};

constexpr GridCell operator+(GridCell a, GridCell b) { return {a.row + b.row, a.column + b.column}; }

// The steps across the sides of a cell: to the east, north, west and south.
inline constexpr std::array<GridCell, 4> SIDES{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};

// Whether a grid of this shape, (rows, columns), has such a cell.
constexpr bool is_inside(std::array<i64, 2> shape, GridCell cell) {
    return 0 <= cell.row && cell.row < shape[0] && 0 <= cell.column && cell.column < shape[1];
}

// The value of a cell.
template <class T>
constexpr T& at(View<T, 2> grid, GridCell cell) {
    return grid(cell.row, cell.column);
}

// The cells, row by row, from which numbers spread over a mask: those that have one, beside a cell of the mask that has
// none (-1).
inline std::queue<GridCell> front_of(View<const i32, 2> numbers, View<const bool, 2> mask) {
    std::queue<GridCell> front;
    const auto is_open = [&](GridCell cell) {
        return is_inside(mask.shape, cell) && at(mask, cell) && at(numbers, cell) == -1;
    };
    for (i64 row = 0; row < mask.shape[0]; ++row) {
        for (i64 column = 0; column < mask.shape[1]; ++column) {
            const GridCell cell{row, column};
            if (at(numbers, cell) == -1) continue;
            if (std::ranges::any_of(SIDES, [&](GridCell side) { return is_open(cell + side); })) front.push(cell);
        }
    }
    return front;
}

}  // namespace fleet2d
