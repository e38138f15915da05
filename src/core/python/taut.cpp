#include "../taut.hpp"

#include "arrays.hpp"
#include "line_of_sight.hpp"
#include "mesh.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_taut(nb::module_& m) {
    m.def(
        "leg_cost",
        [](View<const i32, 2> cost, i64 ax, i64 ay, i64 bx, i64 by) {
            check_point(ax, ay);
            check_point(bx, by);
            return leg_cost(cost, {ax, ay}, {bx, by});
        },
        "cost"_a, "ax"_a, "ay"_a, "bx"_a, "by"_a,
        R"(Return the cost of a straight leg [percent times lattice units]; infinite if it is blocked.

Each part of it has the cost of the cell that it crosses.

Args:
    cost: int32 (rows, columns), -1 where no way leads.
    ax: Position of its begin [lattice units].
    ay: Position of its begin [lattice units].
    bx: Position of its end [lattice units].
    by: Position of its end [lattice units].)");
    m.def(
        "pull_taut",
        [](const Mesh& mesh, View<const i32, 2> cost, View<const i64, 2> way) {
            check_points(way);
            return pull_taut(mesh, cost, way);
        },
        "mesh"_a, "cost"_a, "way"_a, Unlocked(),
        R"(Return a path with fewer corners: legs are joined while the result is free and not more expensive.

Args:
    mesh: The space that the path must stay in.
    cost: int32 (rows, columns), -1 where no way leads.
    way: int64 (n, 2), lattice points; each leg lies in the space.

Returns:
    int64 (m, 2), a subset of the points, with the first and the last.)");
}

}  // namespace fleet2d
