#include "../moved_walls.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_moved_walls(nb::module_& m) {
    m.def(
        "move_walls",
        [](View<const i64, 2> ring, i64 reach, i64 half) {
            constexpr i64 limit = i64{1} << 30;
            require(ring.shape[1] == 2, "ring must be (n, 2)");
            require(all_in_range(ring, -limit, limit), "coordinates must be within 2**30");
            require(0 <= half && half <= reach && reach < limit, "half must be in 0 to reach, that below 2**30");
            return move_walls(ring, reach, half);
        },
        "ring"_a, "reach"_a, "half"_a, Unlocked(),
        R"(Return an outline whose walls along the axes are moved to their left, into the free space.

Where it turns right, an octagon goes round the corner.

Args:
    ring: Its corners, each once, int64 (n, 2) [lattice units].
    reach: Distance of the octagon's straight sides from its middle [lattice units].
    half: Half the length of these sides [lattice units].

Returns:
    Its corners, int64 (m, 2); none if a wall is slanted, or if one but a step that the octagon
    hides would vanish.)");
}

}  // namespace fleet2d
