#include "../obstacles.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

constexpr i64 LARGEST_NUMBER = i64{1} << 30;  // coordinates, and the octagon's sides

void check_octagon(i64 reach, i64 half) {
    require(0 <= half && half <= reach && reach < LARGEST_NUMBER, "half must be in 0 to reach, that below 2**30");
}

}  // namespace

void bind_obstacles(nb::module_& m) {
    m.def(
        "wall_obstacles",
        [](View<const i64, 2> corners, View<const i64> ring_of, i64 reach, i64 half) {
            require(corners.shape[1] == 2 && ring_of.size() == corners.size(),
                    "corners must be (n, 2), and ring_of as many");
            require(all_in_range(corners, -LARGEST_NUMBER, LARGEST_NUMBER), "coordinates must be within 2**30");
            check_octagon(reach, half);
            return wall_obstacles(corners, ring_of, reach, half);
        },
        "corners"_a, "ring_of"_a, "reach"_a, "half"_a, Unlocked(),
        R"(Return the obstacles that walls are to a body, for `add_obstacles`.

Args:
    corners: Those of closed rings, the first of each once more at its end, int64 (n, 2) [lattice units].
    ring_of: The ring of each corner, int64 (n,).
    reach: Distance of the straight sides of the body's octagon from its middle [lattice units].
    half: Half the length of these sides [lattice units].

Returns:
    int64 (walls, 10): least and greatest x, y, x + y and x - y of each, a number that it shares
    with those that it touches, also through others, and whether it is slanted.)");
    m.def(
        "add_obstacles",
        [](View<const i64, 2> obstacles, View<const i64, 2> boxes, i64 reach, i64 half) {
            require(obstacles.shape[1] == OBSTACLE_COLUMNS, "obstacles must be (n, 10)");
            require(all_in_range(obstacles, -4 * LARGEST_NUMBER, 4 * LARGEST_NUMBER), "obstacles must be within 2**32");
            for (i64 i = 0; i < obstacles.size(); ++i) require(obstacles(i, 8) >= 0, "numbers must be 0 or more");
            require(boxes.shape[1] == 4, "boxes must be (n, 4)");
            require(all_in_range(boxes, -LARGEST_NUMBER, LARGEST_NUMBER), "coordinates must be within 2**30");
            check_octagon(reach, half);
            return add_obstacles(obstacles, boxes, reach, half);
        },
        "obstacles"_a, "boxes"_a, "reach"_a, "half"_a, Unlocked(),
        R"(Add rectangles to obstacles, and count how often they may cut a body's space in two.

Args:
    obstacles: From `wall_obstacles` or this, int64 (n, 10).
    boxes: Least x and y, and greatest, of further ones, int64 (m, 4) [lattice units].
    reach: As of `wall_obstacles`.
    half: As of `wall_obstacles`.

Returns:
    All obstacles, int64 (n + m, 10), and the count: 0 if each part of the space that isn't covered
    whole certainly stays in one piece.)");
}

}  // namespace fleet2d
