#include "furniture.hpp"

#include <algorithm>
#include <iterator>

namespace fleet2d {
namespace {

constexpr int TURNS = 4;

// Some rows and columns of a window.
struct CellBox {
    i64 row, column, high, wide;
};

// The same box in the window before it was turned; `shape` is that of the window before.
CellBox unturned(const CellBox& box, int turn, std::array<i64, 2> shape) {
    const auto [rows, columns] = shape;
    switch (turn) {
        case 1:
            return {box.column, columns - box.row - box.high, box.wide, box.high};
        case 2:
            return {rows - box.row - box.high, columns - box.column - box.wide, box.high, box.wide};
        case 3:
            return {rows - box.column - box.wide, box.row, box.wide, box.high};
        default:
            return box;
    }
}

// The number of cells of a mask in a box, by the mask's corner_sums.
i64 count_in(View<const i32, 2> sums, const CellBox& box) {
    const i64 top = box.row + box.high, right = box.column + box.wide;
    return i64{sums(top, right)} - sums(box.row, right) - sums(top, box.column) + sums(box.row, box.column);
}

// corner_sums of the cells of a mask that aren't occupied.
Array<i32, 2> empty_sums(View<const bool, 2> mask, View<const bool, 2> occupied) {
    const auto [rows, columns] = mask.shape;
    auto result = Array<i32, 2>::empty({rows + 1, columns + 1});
    const View<i32, 2> sums = result;
    std::ranges::fill(sums[0], 0);
    for (i64 row = 0; row < rows; ++row) {
        i32 in_row = 0;
        sums(row + 1, 0) = 0;
        for (i64 column = 0; column < columns; ++column) {
            in_row += mask(row, column) && !occupied(row, column) ? 1 : 0;
            sums(row + 1, column + 1) = sums(row, column + 1) + in_row;
        }
    }
    return result;
}

// The smallest box of all cells of a mask.
CellBox extent_of(View<const bool, 2> mask) {
    const auto [rows, columns] = mask.shape;
    i64 row = rows, end_row = 0, column = columns, end_column = 0;
    for (i64 i = 0; i < rows; ++i) {
        const View<const bool> cells = mask[i];
        const bool* const first = std::find(cells.begin(), cells.end(), true);
        if (first == cells.end()) continue;
        row = std::min(row, i);
        end_row = i + 1;
        column = std::min(column, first - cells.begin());
        end_column = std::max(
            end_column, columns - (std::find(std::reverse_iterator(cells.end()), std::reverse_iterator(first), true) -
                                   std::reverse_iterator(cells.end())));
    }
    return {row, column, std::max(end_row - row, i64{0}), std::max(end_column - column, i64{0})};
}

// Finds the places of one group in one room.
class PlaceFinder {
public:
    PlaceFinder(const RoomFloor& floor, View<const bool, 2> occupied, const GroupRule& group)
        : floor_(floor),
          group_(group),
          shape_(floor.holds.shape),
          holds_(empty_sums(floor.holds, occupied)),
          whole_(group.front > 0 ? empty_sums(floor.whole, occupied) : Array<i32, 2>{}),
          extent_(extent_of(floor.holds)) {}

    // Append the places in the window turned by `turn`; returns the new number of places.
    i64 append_places(int turn, Array<i64, 2>& places, i64 count) const {
        const i64 rows = turn % 2 == 0 ? shape_[0] : shape_[1], columns = turn % 2 == 0 ? shape_[1] : shape_[0];
        const CellBox extent = unturned(extent_, (TURNS - turn) % TURNS, {rows, columns});  // turned, in fact
        const i64 last_row = std::min(extent.row + extent.high, rows - group_.front) - group_.depth;
        const i64 last_column = extent.column + extent.wide - group_.width;
        for (i64 row = extent.row; row <= last_row; ++row) {
            for (i64 column = extent.column; column <= last_column; ++column) {
                if (!is_possible(turn, row, column)) continue;
                places.grow(count + 1, count);
                const View<i64> place = places.view()[count++];
                place[0] = turn, place[1] = row, place[2] = column, place[3] = points_at(turn, row, column);
            }
        }
        return count;
    }

private:
    bool is_possible(int turn, i64 row, i64 column) const {
        const auto is_full = [&](View<const i32, 2> sums, const CellBox& box) {
            return count_in(sums, unturned(box, turn, shape_)) == box.high * box.wide;
        };
        // Most places of a group that needs a wall have none behind them.
        return before_wall(turn, turn, {row, column, 1, group_.width}) >= group_.backed &&
               is_full(holds_.view(), {row, column, group_.depth, group_.width}) &&
               (group_.front == 0 || is_full(whole_.view(), {row + group_.depth, column, group_.front, group_.width}));
    }

    i64 points_at(int turn, i64 row, i64 column) const {
        const i64 width = group_.width, depth = group_.depth, most = group_.far * group_.far;
        const i64 right = before_wall(turn + TURNS - 1, turn, {row, column, depth, 1});
        const i64 left = before_wall(turn + 1, turn, {row, column + width - 1, depth, 1});
        const CellBox middle = unturned({row + depth / 2, column + width / 2, 1, 1}, turn, shape_);
        const i64 distance = std::clamp(floor_.from_doors(middle.row, middle.column), i64{0}, most);
        return group_.corner * std::max(left, right) / depth + distance * group_.away / most;
    }

    // The number of cells of a box of the turned window that are before the wall on a side of it.
    i64 before_wall(int side, int turn, const CellBox& box) const {
        return count_in(floor_.before_walls[side % TURNS], unturned(box, turn, shape_));
    }

    const RoomFloor& floor_;
    const GroupRule& group_;
    std::array<i64, 2> shape_;
    Array<i32, 2> holds_, whole_;  // corner_sums of the cells that aren't occupied
    CellBox extent_;               // the cells that furniture may cover
};

}  // namespace

Array<i32, 2> corner_sums(View<const bool, 2> mask) {
    return empty_sums(mask, Array<bool, 2>::zeros(mask.shape).view());
}

Array<i64, 2> group_places(const RoomFloor& floor, View<const bool, 2> occupied, const GroupRule& group) {
    const PlaceFinder finder(floor, occupied, group);
    auto places = Array<i64, 2>::empty({256, 4});
    i64 count = 0;
    for (int turn = 0; turn < TURNS; ++turn) count = finder.append_places(turn, places, count);
    places.truncate(count);
    return places;
}

}  // namespace fleet2d
