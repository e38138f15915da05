#include "masks.hpp"

#include <algorithm>
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
    const GridCell start = corner;
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
    } while (corner != start || direction != EAST);
    return count;
}

// Runs of the pixels of a mask in its rows, and which of them are connected.
class PixelRuns {
public:
    struct Run {
        i64 row, begin, end;
        std::size_t earlier;  // a run that this one is connected to; itself if it is the first of its part
        i32 part = NOWHERE;
    };

    std::size_t size() const { return runs_.size(); }
    const Run& operator[](std::size_t run) const { return runs_[run]; }

    std::size_t add(i64 row, i64 begin, i64 end) {
        runs_.push_back({row, begin, end, size()});
        return size() - 1;
    }

    void connect(std::size_t one, std::size_t other) {
        const auto [earlier, later] = std::minmax({first_of(one), first_of(other)});
        runs_[later].earlier = earlier;
    }

    // The number of the part of each pixel, NOWHERE between the runs.
    Array<i32, 2> number_parts(std::array<i64, 2> shape) {
        auto result = Array<i32, 2>::filled(shape, NOWHERE);
        const View<i32, 2> part = result;
        i32 parts = 0;
        for (Run& run : runs_) {
            const Run& earlier = runs_[run.earlier];
            run.part = &earlier == &run ? parts++ : earlier.part;
            const auto pixels = part[run.row].slice(run.begin, run.end);
            std::fill(pixels.begin(), pixels.end(), run.part);
        }
        return result;
    }

private:
    // The first run of a run's part, as far as is known.
    std::size_t first_of(std::size_t run) {
        while (runs_[run].earlier != run) run = runs_[run].earlier = runs_[runs_[run].earlier].earlier;
        return run;
    }

    std::vector<Run> runs_;
};

}  // namespace

Array<i32, 2> label_parts(View<const bool, 2> mask, bool diagonal) {
    const auto [rows, columns] = mask.shape;
    const i64 reach = diagonal ? 1 : 0;
    PixelRuns runs;
    std::size_t below = 0;  // the first run of the row below that may touch the next one
    for (i64 row = 0; row < rows; ++row) {
        const std::size_t first = runs.size();
        for (i64 column = 0; column < columns; ++column) {
            if (!mask(row, column)) continue;
            const i64 begin = column;
            while (column < columns && mask(row, column)) ++column;
            const std::size_t run = runs.add(row, begin, column);
            while (below < first && runs[below].end + reach <= begin) ++below;
            for (std::size_t each = below; each < first && runs[each].begin < column + reach; ++each) {
                runs.connect(each, run);
            }
        }
        below = first;
    }
    return runs.number_parts(mask.shape);
}

Array<i32, 2> count_steps(View<const bool, 2> start, View<const bool, 2> mask) {
    const auto [rows, columns] = mask.shape;
    auto result = Array<i32, 2>::filled(mask.shape, NOWHERE);
    const View<i32, 2> steps = result;
    for (i64 row = 0; row < rows; ++row) {
        for (i64 column = 0; column < columns; ++column) {
            if (start(row, column) && mask(row, column)) steps(row, column) = 0;
        }
    }
    std::queue<GridCell> waiting = front_of(steps, mask);
    for (; !waiting.empty(); waiting.pop()) {
        const GridCell pixel = waiting.front();
        for (const GridCell side : SIDES) {
            const GridCell beside = pixel + side;
            if (!is_inside(mask.shape, beside) || !at(mask, beside) || at(steps, beside) != NOWHERE) continue;
            at(steps, beside) = at(steps, pixel) + 1;
            waiting.push(beside);
        }
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
