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

// Whether visits that begin at these steps make up all steps.
bool is_division(View<const i64> begin, i64 steps) {
    bool rises = steps >= 0 && (steps == 0 || (begin.size() > 0 && begin[0] == 0));
    for (i64 i = 1; i < begin.size(); ++i) rises &= begin[i - 1] < begin[i];
    return rises && (begin.size() == 0 || begin[begin.size() - 1] < steps || steps == 0);
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
        "count_together",
        [](View<const i64> begin, View<const i16> room, View<const i64> other_begin, View<const i16> other_room,
           i64 steps) {
            require(begin.size() == room.size() && other_begin.size() == other_room.size(),
                    "begin and room of a body must have one length");
            require(is_division(begin, steps) && is_division(other_begin, steps),
                    "begin must ascend from 0, and stay below the number of steps");
            return count_together(begin, room, other_begin, other_room, steps);
        },
        "begin"_a, "room"_a, "other_begin"_a, "other_room"_a, "steps"_a, Unlocked(),
        R"(Return at how many steps two bodies are in the same room.

Args:
    begin: int64 (n,), the step at which each visit of a body begins; rising from 0.
    room: int16 (n,), the room of each visit, below 0 for none.
    other_begin: int64 (m,), the same of the other body.
    other_room: int16 (m,), the same of the other body.
    steps: Number of steps.)");
    m.def(
        "sum_moves",
        [](const Poses& poses, View<const i64, 2> portals) {
            check_poses(poses);
            check_portals(portals);
            return sum_moves(poses, portals);
        },
        "poses"_a, "portals"_a, Unlocked(),
        R"(Return the summed length of the moves from pose to pose [lattice units].

Args:
    poses: The poses.
    portals: int64 (m, 5), the ends of portals, which have no length: x, y, x, y, and how far from them bodies stand
        [lattice units].)");
}

}  // namespace fleet2d
