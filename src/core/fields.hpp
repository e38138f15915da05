// Fields over the cells of a grid: distances to walls and to places.
#pragma once

#include "grid.hpp"

namespace fleet2d {

inline constexpr i64 MAX_COST = 1000;  // the highest cost of a cell [percent]

// Each cell's exact squared distance to the nearest cell that is not in `mask`, in cells, (rows,
// columns): 0 outside the mask, and (rows + columns)² everywhere in a mask that has no outside.
//
// The two-pass algorithm of Meijster, Roerdink and Hesselink, "A general algorithm for computing
// distance transforms in linear time" (2000), in integers. Cells outside the array are ignored:
// surround the mask by one line of false where the border is a wall.
Array<i64, 2> squared_distance(View<const bool, 2> mask);

// The sum of the values in the square of cells that reaches so far to all sides of each, (rows,
// columns); outside the array they are 0.
Array<i64, 2> box_sums(View<const i64, 2> values, i64 reach);

// The peak of each cell, to which the steepest way up leads, (rows, columns): peaks are numbered
// row by row; -1 for cells without a label. Ways lead across sides, from label to equal label; of
// equally high cells, later ones count as higher.
Array<i32, 2> climb(View<const i32, 2> labels, View<const i64, 2> height);

// The walking distance from each cell to the nearest goal, in fifths of a cell's side, (rows,
// columns); -1 where no goal can be reached.
//
// A step to a side costs 5 and one across a corner 7, which is open only if both cells beside it
// are. `mask` holds the cells that can be walked; `goals` are cells (n, 2) as (row, column); goals
// outside the mask are ignored.
//
// Cells are settled in order of distance, and so are the cells reached by steps of one length: one
// queue for each length replaces a heap (Dial, Communications of the ACM 12, 1969, has one for each
// distance).
Array<i32, 2> walking_distance(View<const bool, 2> mask, View<const i64, 2> goals);

inline constexpr i64 FREE_COST = 200;  // of a step for each fifth of a cell's side, without extra cost

// The cost of a step between two neighboring cells [1/1000 of a cell's side].
//
// A step to a side is 5 long and one across a corner 7; half of it counts by the cost of the cell
// that it leaves, half by that of the one it enters.
constexpr i64 step_cost(View<const i32, 2> cost, GridCell from, GridCell to) {
    const i64 length = from.row == to.row || from.column == to.column ? 5 : 7;
    return length * (FREE_COST + at(cost, from) + at(cost, to));
}

// The cells (n, 2) of a cheapest path from one cell to another; of equally cheap next ones the first, row by row. Empty
// if there is no path.
//
// `cost` is the extra cost of cells, (rows, columns), in percent: 100 doubles it; from 0 to
// MAX_COST, or -1 for blocked cells (A*, from the goal; all in integers).
Array<i64, 2> cheapest_cells(View<const i32, 2> cost, GridCell start, GridCell goal);

}  // namespace fleet2d
