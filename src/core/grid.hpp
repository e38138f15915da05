// Grids of cells: rows and columns, and the cells beside one.
#pragma once

#include <array>

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
// The steps across its corners: to the southwest, southeast, northwest and northeast.
inline constexpr std::array<GridCell, 4> CORNERS{{{-1, -1}, {-1, 1}, {1, -1}, {1, 1}}};

// Whether a grid of this shape, (rows, columns), has such a cell.
constexpr bool is_inside(std::array<i64, 2> shape, GridCell cell) {
    return 0 <= cell.row && cell.row < shape[0] && 0 <= cell.column && cell.column < shape[1];
}

// The value of a cell.
template <class T>
constexpr T& at(View<T, 2> grid, GridCell cell) {
    return grid(cell.row, cell.column);
}

}  // namespace fleet2d
