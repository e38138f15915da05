#include "../fields.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

using Cell = std::pair<i64, i64>;

GridCell grid_cell(Cell cell) { return {cell.first, cell.second}; }

// The cell, which must be one of the grid.
GridCell cell_of(View<const i32, 2> cost, Cell cell) {
    require(is_inside(cost.shape, grid_cell(cell)), "there is no such cell");
    return grid_cell(cell);
}

void check_costs(View<const i32, 2> cost) {
    require(all_in_range(cost, -1, MAX_COST + 1), "costs must be in 0 to 1000, or -1 where no way leads");
}

}  // namespace

void bind_fields(nb::module_& m) {
    m.attr("MAX_COST") = MAX_COST;

    m.def("squared_distance", &squared_distance, "mask"_a, Unlocked(),
          R"(Return each cell's exact squared distance to the nearest cell that is not in `mask`.

Cells outside the array are ignored: surround the mask by one line of False where the
border is a wall.

Args:
    mask: Cells to measure, bool (rows, columns).

Returns:
    Squared distances in cells, int64 (rows, columns); 0 outside the mask, and
    (rows + columns)² everywhere in a mask that has no outside.)");
    m.def(
        "box_sums",
        [](View<const i64, 2> values, i64 reach) {
            const i64 cells = std::max(values.shape[0] * values.shape[1], i64{1});
            require(0 <= reach && reach < i64{1} << 31, "reach must be in 0 to 2**31 - 1");
            const i64 most = (i64{1} << 62) / cells;
            require(all_in_range(values, -most, most + 1), "values must be within 2**62 / (rows * columns)");
            return box_sums(values, reach);
        },
        "values"_a, "reach"_a, Unlocked(),
        R"(Return the sum of the values in the square of cells that reaches so far to all sides of each.

Args:
    values: int64 (rows, columns); outside the array they are 0.
    reach: Cells to each side.

Returns:
    int64 (rows, columns).)");
    m.def(
        "climb",
        [](View<const i32, 2> labels, View<const i64, 2> height) {
            require(labels.shape == height.shape, "labels and height must have one shape");
            return climb(labels, height);
        },
        "labels"_a, "height"_a, Unlocked(),
        R"(Return the peak of each cell, to which the steepest way up leads.

Ways lead across sides, from label to equal label. Of equally high cells, later ones count as higher.

Args:
    labels: int32 (rows, columns), -1 for none.
    height: int64 (rows, columns).

Returns:
    Peaks, numbered row by row, int32 (rows, columns); -1 for cells without a label.)");
    m.def(
        "walking_distance",
        [](View<const bool, 2> mask, View<const i64, 2> goals) {
            require(goals.shape[1] == 2, "goals must be (n, 2)");
            return walking_distance(mask, goals);
        },
        "mask"_a, "goals"_a, Unlocked(),
        R"(Return the walking distance from each cell to the nearest goal.

A step to a side costs 5 and one across a corner 7, which is open only if both cells beside it
are.

Args:
    mask: Cells that can be walked, bool (rows, columns).
    goals: Goal cells, int64 (n, 2) as (row, column); goals outside the mask are ignored.

Returns:
    int32 (rows, columns), fifths of a cell's side; -1 where no goal can be reached.)");
    m.def(
        "step_cost",
        [](View<const i32, 2> cost, i64 row, i64 column, i64 r, i64 c) {
            return step_cost(cost, cell_of(cost, {row, column}), cell_of(cost, {r, c}));
        },
        "cost"_a, "row"_a, "column"_a, "r"_a, "c"_a,
        "Return the cost of a step between two neighboring cells [1/1000 of a cell's side].");
    m.def(
        "cheapest_cells",
        [](View<const i32, 2> cost, Cell start, Cell goal) {
            check_costs(cost);
            return cheapest_cells(cost, cell_of(cost, start), cell_of(cost, goal));
        },
        "cost"_a, "start"_a, "goal"_a, Unlocked(),
        R"(Return the cells of a cheapest path from one cell to another.

A step to a side is 5 long and one across a corner 7, which is open only if both cells beside it
are; half of it counts by the cost of the cell that it leaves, half by that of the one it enters.
Of equally cheap next cells it takes the first.

Args:
    cost: int32 (rows, columns), in percent of what a way costs besides: 100 counts double; from
        0 to 1000, or -1 where no way leads.
    start: The cell (row, column) where it begins.
    goal: The cell (row, column) where it ends.

Returns:
    int64 (n, 2) as (row, column); empty if there is no path.)");
}

}  // namespace fleet2d
