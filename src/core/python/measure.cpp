#include "../measure.hpp"

#include "poses.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

Array<i16> checked_rooms_at(View<const i16, 2> room_of_place, View<const i64> x, View<const i64> y) {
    require(room_of_place.shape[0] > 0 && room_of_place.shape[1] > 0, "room_of_place must have a cell");
    require(x.size() == y.size(), "x and y must have one length");
    return rooms_at(room_of_place, x, y);
}

}  // namespace

void bind_measure(nb::module_& m) {
    m.def("rooms_at", &checked_rooms_at, "room_of_place"_a, "x"_a, "y"_a, Unlocked(),
          R"(Return the room of each place; outside of the map that at its nearest border.

Args:
    room_of_place: int16 (rows, columns), the room of each cell.
    x: int64 (n,), lattice units.
    y: int64 (n,), lattice units.

Returns:
    int16 (n,).)");
    m.def(
        "count_rooms",
        [](const Poses& poses, View<const i16, 2> room_of_place, View<i64> counts) {
            check_poses(poses);
            const Array<i16> rooms = checked_rooms_at(room_of_place, poses.x, poses.y);
            require(counts.size() > 0 && all_in_range(rooms.view(), -1, counts.size() - 1),
                    "counts must have an entry for each room, and one more");
            count_rooms(rooms, poses.away, counts);
        },
        "poses"_a, "room_of_place"_a, "counts"_a, Unlocked(),
        R"(Add the number of poses in each room to `counts`.

Args:
    poses: Poses.
    room_of_place: int16 (rows, columns), the room of each cell, -1 for none.
    counts: int64 (rooms + 1,), to be added to; the last entry is away, or in no room.)");
    m.def(
        "sum_moves",
        [](const Poses& poses) {
            check_poses(poses);
            return sum_moves(poses);
        },
        "poses"_a, Unlocked(), "Return the summed length of the moves from pose to pose [lattice units].");
}

}  // namespace fleet2d
