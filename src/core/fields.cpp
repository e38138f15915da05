#include "fields.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <vector>

#include "lattice.hpp"

namespace fleet2d {
namespace {

// Each cell's distance to the nearest cell of its column that is not in the mask, `endless` for none.
Array<i64, 2> column_gaps(View<const bool, 2> mask, i64 endless) {
    const auto [rows, columns] = mask.shape;
    auto result = Array<i64, 2>::empty(mask.shape);
    const View<i64, 2> gap = result;
    for (i64 row = 0; row < rows; ++row) {
        for (i64 column = 0; column < columns; ++column) {
            const i64 below = row > 0 ? gap(row - 1, column) : endless;
            gap(row, column) = mask(row, column) ? std::min(below + 1, endless) : 0;
        }
    }
    for (i64 row = rows - 2; row >= 0; --row) {
        for (i64 column = 0; column < columns; ++column) {
            gap(row, column) = std::min(gap(row, column), gap(row + 1, column) + 1);
        }
    }
    return result;
}

// The squared distances of the cells of a row, from the gaps of its columns: the lower envelope of
// one parabola for each column.
class Envelope {
public:
    explicit Envelope(i64 columns) : apex_(Array<i64>::empty({columns})), start_(Array<i64>::empty({columns})) {}

    void measure(View<const i64> gap, i64 most, View<i64> squared) {
        const i64 columns = gap.size();
        i64 top = 0;
        apex_[0] = start_[0] = 0;
        for (i64 column = 1; column < columns; ++column) {
            while (top >= 0 && height(gap, apex_[top], start_[top]) > height(gap, column, start_[top])) --top;
            const i64 crossing = top < 0 ? 0 : first_below(gap, apex_[top], column);
            if (crossing >= columns) continue;
            ++top;
            apex_[top] = column;
            start_[top] = crossing;
        }
        for (i64 column = columns - 1; column >= 0; --column) {
            squared[column] = std::min(height(gap, apex_[top], column), most);
            if (column == start_[top]) --top;
        }
    }

private:
    // The height at a column of the parabola with its apex at another.
    static i64 height(View<const i64> gap, i64 apex, i64 column) {
        return (column - apex) * (column - apex) + gap[apex] * gap[apex];
    }

    // The first column at which the parabola of `right` is below that of `left`.
    static i64 first_below(View<const i64> gap, i64 left, i64 right) {
        const i64 rise = right * right - left * left + gap[right] * gap[right] - gap[left] * gap[left];
        return 1 + floor_div(rise, 2 * (right - left));
    }

    Array<i64> apex_;   // columns whose parabolas form the envelope, from left to right
    Array<i64> start_;  // first column at which each of them is the lowest
};

// The costs of a step to a side of a cell, and across a corner.
constexpr i32 STRAIGHT = 5, ACROSS = 7;

// A grid with a wall around it, so that no step leads out, and the distances of its cells.
// Cells are numbered row by row.
class Walk {
public:
    explicit Walk(View<const bool, 2> mask)
        : wide_(mask.shape[1] + 2), distance_(Array<i32>::filled({(mask.shape[0] + 2) * wide_}, CLOSED)) {
        for (i64 row = 0; row < mask.shape[0]; ++row) {
            for (i64 column = 0; column < mask.shape[1]; ++column) {
                if (mask(row, column)) distance_[number({row, column})] = FAR;
            }
        }
    }

    void start_at(GridCell goal) { reach(number(goal), 0); }

    // Measure the distances of all cells, the nearest ones first.
    void measure() {
        for (i32 now = 0; waiting_ > 0; ++now) {
            std::vector<i64>& cells = buckets_[bucket_of(now)];  // none is added to it by a step
            for (const i64 cell : cells) {
                if (distance_[cell] == now) step_from(cell, now);
            }
            waiting_ -= cells.size();
            cells.clear();
        }
    }

    // The result as of walking_distance.
    i32 distance(GridCell cell) const {
        const i32 known = distance_[number(cell)];
        return known < FAR ? known : -1;
    }

private:
    static constexpr i32 CLOSED = -1, FAR = std::numeric_limits<i32>::max();
    static constexpr std::size_t BUCKETS = 8;
    static_assert(STRAIGHT < ACROSS && ACROSS < BUCKETS);

    static std::size_t bucket_of(i32 distance) { return static_cast<std::size_t>(distance) % BUCKETS; }
    i64 number(GridCell cell) const { return (cell.row + 1) * wide_ + cell.column + 1; }

    void step_from(i64 cell, i32 now) {
        const bool left = distance_[cell - 1] != CLOSED, right = distance_[cell + 1] != CLOSED;
        if (left) reach(cell - 1, now + STRAIGHT);
        if (right) reach(cell + 1, now + STRAIGHT);
        for (const i64 beyond : {cell - wide_, cell + wide_}) {
            if (distance_[beyond] == CLOSED) continue;
            reach(beyond, now + STRAIGHT);
            if (left) reach(beyond - 1, now + ACROSS);  // it cuts no corner
            if (right) reach(beyond + 1, now + ACROSS);
        }
    }

    void reach(i64 cell, i32 distance) {
        if (distance >= distance_[cell]) return;  // as of all closed cells
        distance_[cell] = distance;
        buckets_[bucket_of(distance)].push_back(cell);
        ++waiting_;
    }

    i64 wide_;
    Array<i32> distance_;
    std::array<std::vector<i64>, BUCKETS> buckets_;  // cells to step from, by distance; some are nearer since
    std::size_t waiting_ = 0;                        // their number
};

// A cell that a search has reached.
struct ReachedCell {
    i64 bound;      // of the cost of a path through it
    i64 travelled;  // the cost from the goal
    GridCell cell;
};

// The reached cells from which a search goes on, the lowest bounds first; among bounds that differ by less than WIDTH
// in any order. None is pushed with a lower bound than the last that was popped, or one more than a step higher.
class WaitingCells {
public:
    explicit WaitingCells(i64 bound) : lowest_(bound / WIDTH) {}

    void push(const ReachedCell& reached) {
        buckets_[number_of(reached.bound / WIDTH)].push_back(reached);
        ++size_;
    }

    // Whether a cell waits whose bound may be so high at most.
    bool has_one_below(i64 bound) {
        if (size_ == 0) return false;
        while (buckets_[number_of(lowest_)].empty()) ++lowest_;
        return lowest_ * WIDTH <= bound;
    }

    ReachedCell pop() {
        auto& cells = buckets_[number_of(lowest_)];
        const ReachedCell reached = cells.back();
        cells.pop_back();
        --size_;
        return reached;
    }

private:
    static constexpr i64 WIDTH = FREE_COST;
    static constexpr std::size_t BUCKETS = 128;
    static_assert(ACROSS * (FREE_COST + 2 * MAX_COST) + ACROSS * FREE_COST < WIDTH * (static_cast<i64>(BUCKETS) - 1));

    static std::size_t number_of(i64 bucket) { return static_cast<std::size_t>(bucket) % BUCKETS; }

    std::array<std::vector<ReachedCell>, BUCKETS> buckets_;
    i64 lowest_;
    i64 size_ = 0;
};

// The steps to the eight neighbors, row by row.
constexpr std::array<GridCell, 8> NEIGHBORS{{{-1, -1}, {-1, 0}, {-1, 1}, {0, -1}, {0, 1}, {1, -1}, {1, 0}, {1, 1}}};

// Whether a step leads to a neighboring cell that is open; across a corner, both cells beside it must be.
bool is_open(View<const i32, 2> cost, GridCell from, GridCell to) {
    return is_inside(cost.shape, to) && at(cost, to) >= 0 && cost(from.row, to.column) >= 0 &&
           cost(to.row, from.column) >= 0;
}

constexpr i32 NO_PEAK = -1;  // the peak of a cell without a label

// The highest of a cell and the cells beside it that have its label, of equally high ones the last.
GridCell steepest(View<const i32, 2> labels, View<const i64, 2> height, GridCell cell) {
    constexpr std::array<GridCell, 5> IN_ORDER{{{-1, 0}, {0, -1}, {0, 0}, {0, 1}, {1, 0}}};
    GridCell highest = cell;
    i64 most = std::numeric_limits<i64>::min();
    for (const GridCell step : IN_ORDER) {
        const GridCell there = cell + step;
        if (!is_inside(labels.shape, there) || at(labels, there) != at(labels, cell)) continue;
        if (at(height, there) < most) continue;
        most = at(height, there);
        highest = there;
    }
    return highest;
}

}  // namespace

Array<i64, 2> squared_distance(View<const bool, 2> mask) {
    const auto [rows, columns] = mask.shape;
    auto squared = Array<i64, 2>::empty(mask.shape);
    if (columns == 0) return squared;
    const i64 endless = rows + columns;
    const auto gaps = column_gaps(mask, endless);
    Envelope envelope(columns);
    for (i64 row = 0; row < rows; ++row) {
        const auto gap = gaps[row];
        const auto in_row = squared[row];
        for (i64 first = 0, next = 0; first < columns; first = next) {
            // From one gap of 0 to the next: nothing beyond them is nearer.
            for (next = first + 1; next < columns && gap[next] != 0;) ++next;
            if (gap[first] == 0 && next == first + 1) {
                in_row[first] = 0;
            } else {
                const i64 end = std::min(next + 1, columns);
                envelope.measure(gap.slice(first, end), endless * endless, in_row.slice(first, end));
            }
        }
    }
    return squared;
}

Array<i64, 2> box_sums(View<const i64, 2> values, i64 reach) {
    const auto [rows, columns] = values.shape;
    auto result = Array<i64, 2>::empty(values.shape);
    const View<i64, 2> sums = result;
    auto down = Array<i64>::zeros({columns});  // the sums of what is in reach in each column
    const auto add_row = [&](i64 row, i64 sign) {
        if (row < 0 || row >= rows) return;
        for (i64 column = 0; column < columns; ++column) down[column] += sign * values(row, column);
    };
    for (i64 row = 0; row < std::min(reach, rows); ++row) add_row(row, 1);
    for (i64 row = 0; row < rows; ++row) {
        add_row(row + reach, 1);
        i64 sum = 0;
        for (i64 column = 0; column < std::min(reach, columns); ++column) sum += down[column];
        for (i64 column = 0; column < columns; ++column) {
            if (column + reach < columns) sum += down[column + reach];
            sums(row, column) = sum;
            if (column >= reach) sum -= down[column - reach];
        }
        add_row(row - reach, -1);
    }
    return result;
}

Array<i32, 2> climb(View<const i32, 2> labels, View<const i64, 2> height) {
    const auto [rows, columns] = labels.shape;
    auto result = Array<i32, 2>::filled(labels.shape, NO_PEAK);
    const View<i32, 2> peak = result;
    i32 peaks = 0;
    for (i64 row = 0; row < rows; ++row) {
        for (i64 column = 0; column < columns; ++column) {
            const GridCell cell{row, column};
            if (at(labels, cell) >= 0 && steepest(labels, height, cell) == cell) at(peak, cell) = peaks++;
        }
    }
    std::vector<GridCell> way;
    for (i64 row = 0; row < rows; ++row) {
        for (i64 column = 0; column < columns; ++column) {
            if (labels(row, column) < 0) continue;
            GridCell cell{row, column};
            for (; at(peak, cell) == NO_PEAK; cell = steepest(labels, height, cell)) way.push_back(cell);
            for (const GridCell passed : way) at(peak, passed) = at(peak, cell);
            way.clear();
        }
    }
    return result;
}

Array<i32, 2> walking_distance(View<const bool, 2> mask, View<const i64, 2> goals) {
    Walk walk(mask);
    for (i64 i = 0; i < goals.size(); ++i) {
        const GridCell goal{goals(i, 0), goals(i, 1)};
        if (is_inside(mask.shape, goal)) walk.start_at(goal);
    }
    walk.measure();
    auto result = Array<i32, 2>::empty(mask.shape);
    const View<i32, 2> distance = result;
    for (i64 row = 0; row < mask.shape[0]; ++row) {
        for (i64 column = 0; column < mask.shape[1]; ++column) distance(row, column) = walk.distance({row, column});
    }
    return result;
}

Array<i64, 2> cheapest_cells(View<const i32, 2> cost, GridCell start, GridCell goal) {
    auto way = Array<i64, 2>::empty({0, 2});
    if (at(cost, goal) < 0) return way;
    auto distances = Array<i64, 2>::filled(cost.shape, -1);
    const View<i64, 2> distance = distances;
    const auto least_from = [&](GridCell cell) {
        const i64 rows = std::abs(cell.row - start.row), columns = std::abs(cell.column - start.column);
        return FREE_COST * (STRAIGHT * std::max(rows, columns) + (ACROSS - STRAIGHT) * std::min(rows, columns));
    };
    WaitingCells waiting(least_from(goal));
    const auto reach = [&](GridCell cell, i64 travelled) {
        at(distance, cell) = travelled;
        waiting.push({travelled + least_from(cell), travelled, cell});
    };
    reach(goal, 0);
    // Until all cells of all cheapest paths are known.
    for (i64 cheapest = std::numeric_limits<i64>::max(); waiting.has_one_below(cheapest);) {
        const auto [bound, travelled, cell] = waiting.pop();
        if (bound > cheapest || at(distance, cell) != travelled) continue;  // a cheaper path was found since
        if (cell == start) cheapest = travelled;
        for (const GridCell step : NEIGHBORS) {
            const GridCell beside = cell + step;
            if (!is_open(cost, cell, beside)) continue;
            const i64 there = travelled + step_cost(cost, cell, beside);
            if (at(distance, beside) < 0 || there < at(distance, beside)) reach(beside, there);
        }
    }
    const auto next_cell = [&](GridCell cell) {
        for (const GridCell step : NEIGHBORS) {
            const GridCell beside = cell + step;
            if (!is_open(cost, cell, beside) || at(distance, beside) < 0) continue;
            if (at(distance, beside) == at(distance, cell) - step_cost(cost, cell, beside)) return beside;
        }
        throw std::logic_error("a cell has no neighbor on its way");
    };
    if (at(distance, start) < 0) return way;
    i64 count = 0;
    for (GridCell cell = start;; cell = next_cell(cell)) {
        way.grow(count + 1, count);
        way(count, 0) = cell.row;
        way(count, 1) = cell.column;
        ++count;
        if (cell == goal) break;
    }
    way.truncate(count);
    return way;
}

}  // namespace fleet2d
