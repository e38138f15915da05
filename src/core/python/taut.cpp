#include "../taut.hpp"

#include "arrays.hpp"
#include "mesh.hpp"
#include "sight.hpp"
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
        R"(Return what a straight leg costs, [percent times lattice units]; infinite where none leads.

Each part of it counts by the cell that it runs through.

Args:
    cost: int32 (rows, columns), -1 where no way leads.
    ax: Where it begins, lattice units.
    ay: Where it begins, lattice units.
    bx: Where it ends, lattice units.
    by: Where it ends, lattice units.)");
    m.def(
        "pull_taut",
        [](const Mesh& mesh, View<const i32, 2> cost, View<const i64, 2> way) {
            check_points(way);
            return pull_taut(mesh, cost, way);
        },
        "mesh"_a, "cost"_a, "way"_a, Unlocked(),
        R"(Return a way with fewer corners: legs are joined while the joint one is clear and no dearer.

Args:
    mesh: The space that the way must stay in.
    cost: int32 (rows, columns), -1 where no way leads.
    way: int64 (n, 2), lattice points; each leg lies in the space.

Returns:
    int64 (m, 2), some of the points, the first and the last among them.)");
}

}  // namespace fleet2d
