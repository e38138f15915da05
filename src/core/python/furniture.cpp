#include "../furniture.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<RoomFloor> = 4;

template <>
inline constexpr std::size_t border::members_of<GroupRule> = 7;

namespace {

constexpr i64 MOST = i64{1} << 20;  // cells, or points

void check_floor(const RoomFloor& floor, View<const bool, 2> occupied) {
    const auto [rows, columns] = floor.holds.shape;
    require(rows <= MOST && columns <= MOST, "a room must have at most 2**20 rows and columns");
    require(floor.whole.shape == floor.holds.shape && floor.from_doors.shape == floor.holds.shape &&
                occupied.shape == floor.holds.shape,
            "holds, whole, from_doors and occupied must have one shape");
    require(floor.before_walls.shape == std::array<i64, 3>{4, rows + 1, columns + 1},
            "before_walls must be (4, rows + 1, columns + 1)");
}

void check_group(const GroupRule& group) {
    const auto is_size = [](i64 cells) { return 1 <= cells && cells <= MOST; };
    const auto is_part = [](i64 number) { return 0 <= number && number <= MOST; };
    require(is_size(group.width) && is_size(group.depth) && is_size(group.far),
            "width, depth and far must be in 1 to 2**20");
    require(is_part(group.front) && is_part(group.backed) && is_part(group.corner) && is_part(group.away),
            "front, backed, corner and away must be in 0 to 2**20");
}

}  // namespace

void bind_furniture(nb::module_& m) {
    m.def("corner_sums", &corner_sums, "mask"_a, Unlocked(),
          R"(Count the cells of a mask above and left of each corner of the cells.

Args:
    mask: bool (rows, columns).

Returns:
    int32 (rows + 1, columns + 1).)");
    m.def(
        "group_places",
        [](const RoomFloor& floor, View<const bool, 2> occupied, const GroupRule& group) {
            check_floor(floor, occupied);
            check_group(group);
            return group_places(floor, occupied, group);
        },
        "floor"_a, "occupied"_a, "group"_a, Unlocked(),
        R"(Return where a group of furniture can be in a room, and how good each place is.

Args:
    floor: The room, a `RoomFloor`.
    occupied: Cells that other things occupy, bool (rows, columns).
    group: The group, a `GroupRule`.

Returns:
    Turn, first row and first column in the turned window, and points, int64 (n, 4); by turn, row
    and column.)");
}

}  // namespace fleet2d
