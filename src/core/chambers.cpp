#include "chambers.hpp"

#include <algorithm>

#include "grid.hpp"

namespace fleet2d {
namespace {

// The steps to the cells that touch one, those first whose labels count first.
constexpr std::array<GridCell, 8> BESIDE{{{0, -1}, {0, 1}, {-1, 0}, {1, 0}, {-1, -1}, {-1, 1}, {1, -1}, {1, 1}}};

i16 label_beside(View<const i16, 2> labels, GridCell cell) {
    for (const GridCell step : BESIDE) {
        const GridCell beside = cell + step;
        if (is_inside(labels.shape, beside) && at(labels, beside) != NO_LABEL) return at(labels, beside);
    }
    return NO_LABEL;
}

}  // namespace

Array<bool> pairs_in_sight(const Mesh& mesh, View<const i64, 2> eyes, View<const i64, 2> places) {
    auto seen = Array<bool>::empty({eyes.size()});
    i64 triangle = OUTSIDE;
    for (i64 i = 0; i < eyes.size(); ++i) {
        const i64 x = eyes(i, 0), y = eyes(i, 1);
        if (i == 0 || x != eyes(i - 1, 0) || y != eyes(i - 1, 1)) triangle = locate(mesh, x, y);
        seen[i] = line_of_sight(mesh, x, y, triangle, places(i, 0), places(i, 1));
    }
    return seen;
}

Array<i64, 2> label_frames(View<const i32, 2> labels, i64 count) {
    const auto [rows, columns] = labels.shape;
    auto result = Array<i64, 2>::zeros({count, 4});
    const View<i64, 2> frames = result;
    for (i64 label = 0; label < count; ++label) {
        frames(label, 0) = frames(label, 1) = std::max(rows, columns);
    }
    for (i64 row = 0; row < rows; ++row) {
        for (i64 column = 0; column < columns; ++column) {
            if (labels(row, column) == NO_LABEL) continue;
            const View<i64> frame = frames[labels(row, column)];
            frame[0] = std::min(frame[0], row);
            frame[1] = std::min(frame[1], column);
            frame[2] = row + 1;
            frame[3] = std::max(frame[3], column + 1);
        }
    }
    return result;
}

Array<i16, 2> fill_from_neighbors(View<const i16, 2> labels) {
    auto result = Array<i16, 2>::copy_of(labels);
    const View<i16, 2> filled = result;
    for (i64 row = 0; row < labels.shape[0]; ++row) {
        for (i64 column = 0; column < labels.shape[1]; ++column) {
            if (labels(row, column) == NO_LABEL) filled(row, column) = label_beside(labels, {row, column});
        }
    }
    return result;
}

Array<i32, 2> spread_labels(View<const i32, 2> labels, View<const bool, 2> mask) {
    auto result = Array<i32, 2>::filled(labels.shape, NO_LABEL);
    const View<i32, 2> spread = result;
    auto step_counts = Array<i32, 2>::zeros(labels.shape);
    const View<i32, 2> steps = step_counts;
    for (i64 row = 0; row < labels.shape[0]; ++row) {
        for (i64 column = 0; column < labels.shape[1]; ++column) {
            if (mask(row, column)) spread(row, column) = labels(row, column);
        }
    }
    std::queue<GridCell> waiting = front_of(spread, mask);
    while (!waiting.empty()) {
        const GridCell cell = waiting.front();
        waiting.pop();
        const i32 next_step = at(steps, cell) + 1;
        for (const GridCell side : SIDES) {
            const GridCell beside = cell + side;
            if (!is_inside(mask.shape, beside) || !at(mask, beside)) continue;
            if (at(spread, beside) == NO_LABEL) {
                at(spread, beside) = at(spread, cell);
                at(steps, beside) = next_step;
                waiting.push(beside);
            } else if (at(steps, beside) == next_step) {
                // It waits in the queue still: nothing has spread from it.
                at(spread, beside) = std::min(at(spread, beside), at(spread, cell));
            }
        }
    }
    return result;
}

}  // namespace fleet2d
