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

// corner_sums of a mask, read in the window that is turned by so many quarters.
class TurnedSums {
public:
    TurnedSums(View<const i32, 2> sums, int turn) : sign_(turn % 2 == 0 ? 1 : -1) {
        const i64 up = sums.stride[0], last_row = sums.shape[0] - 1, last_column = sums.shape[1] - 1;
        constexpr std::array<std::array<i64, 2>, TURNS> along_row{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};
        const auto ahead = along_row[static_cast<std::size_t>((turn + 1) % TURNS)];
        const auto along = along_row[static_cast<std::size_t>(turn)];
        across_ = ahead[0] * up + ahead[1];
        along_ = along[0] * up + along[1];
        const i64 row = turn == 2 || turn == 3 ? last_row : 0, column = turn == 1 || turn == 2 ? last_column : 0;
        first_ = sums.data + row * up + column;
    }

    // The number of cells of the mask in a box of the turned window.
    i64 count(const CellBox& box) const {
        const i32* const low = first_ + box.row * across_ + box.column * along_;
        const i32* const high = low + box.high * across_;
        const i64 wide = box.wide * along_;
        return sign_ * (i64{high[wide]} - low[wide] - *high + *low);
    }

private:
    const i32* first_ = nullptr;  // that of the corner at which the turned window begins
    i64 across_ = 0, along_ = 0;  // elements from one row or column of the turned window to the next
    i64 sign_;
};

// corner_sums of the cells of a mask that aren't occupied; only those in a part of it are counted and set.
Array<i32, 2> empty_sums(View<const bool, 2> mask, View<const bool, 2> occupied, const CellBox& part) {
    const auto [rows, columns] = mask.shape;
    auto result = Array<i32, 2>::empty({rows + 1, columns + 1});
    const View<i32, 2> sums = result;
    const i64 first = part.column, last = part.column + part.wide;
    std::ranges::fill(sums[part.row].slice(first, last + 1), 0);
    for (i64 row = part.row; row < part.row + part.high; ++row) {
        const View<const bool> cells = mask[row], taken = occupied[row];
        const View<const i32> below = sums[row];
        const View<i32> above = sums[row + 1];
        i32 in_row = 0;
        above[first] = 0;
        for (i64 column = first; column < last; ++column) {
            in_row += static_cast<i32>(cells[column]) & static_cast<i32>(!taken[column]);
            above[column + 1] = below[column + 1] + in_row;
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
          extent_(extent_of(floor.holds)),
          holds_(empty_sums(floor.holds, occupied, extent_)),
          whole_(group.front > 0 ? empty_sums(floor.whole, occupied, {0, 0, shape_[0], shape_[1]}) : Array<i32, 2>{}) {}

    // Append the places in the window turned by `turn`; returns the new number of places.
    i64 append_places(int turn, Array<i64, 2>& places, i64 count) const {
        const i64 rows = turn % 2 == 0 ? shape_[0] : shape_[1], columns = turn % 2 == 0 ? shape_[1] : shape_[0];
        const CellBox extent = unturned(extent_, (TURNS - turn) % TURNS, {rows, columns});  // turned, in fact
        const i64 width = group_.width, depth = group_.depth, front = group_.front;
        const i64 last_row = std::min(extent.row + extent.high, rows - front) - depth;
        const i64 last_column = extent.column + extent.wide - width;
        const TurnedSums holds(holds_, turn), whole(front > 0 ? whole_ : holds_, turn), behind(before_wall(turn), turn),
            right(before_wall(turn + TURNS - 1), turn), left(before_wall(turn + 1), turn);
        for (i64 row = extent.row; row <= last_row; ++row) {
            for (i64 column = extent.column; column <= last_column; ++column) {
                // Most places of a group that needs a wall have none behind them.
                if (behind.count({row, column, 1, width}) < group_.backed) continue;
                if (holds.count({row, column, depth, width}) < depth * width) continue;
                if (front > 0 && whole.count({row + depth, column, front, width}) < front * width) continue;
                places.grow(count + 1, count);
                const View<i64> place = places.view()[count++];
                const i64 beside =
                    std::max(left.count({row, column + width - 1, depth, 1}), right.count({row, column, depth, 1}));
                place[0] = turn, place[1] = row, place[2] = column;
                place[3] = group_.corner * beside / depth + points_away(turn, row, column);
            }
        }
        return count;
    }

private:
    View<const i32, 2> before_wall(int side) const { return floor_.before_walls[side % TURNS]; }

    i64 points_away(int turn, i64 row, i64 column) const {
        const i64 most = group_.far * group_.far;
        const CellBox middle = unturned({row + group_.depth / 2, column + group_.width / 2, 1, 1}, turn, shape_);
        return std::clamp(floor_.from_doors(middle.row, middle.column), i64{0}, most) * group_.away / most;
    }

    const RoomFloor& floor_;
    const GroupRule& group_;
    std::array<i64, 2> shape_;
    CellBox extent_;               // the cells that furniture may cover
    Array<i32, 2> holds_, whole_;  // corner_sums of the cells that aren't occupied
};

}  // namespace

Array<i32, 2> corner_sums(View<const bool, 2> mask) {
    return empty_sums(mask, Array<bool, 2>::zeros(mask.shape).view(), {0, 0, mask.shape[0], mask.shape[1]});
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
