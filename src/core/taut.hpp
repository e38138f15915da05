// Straightening a way over cells of different cost, as far as that makes it no dearer.
#pragma once

#include "mesh.hpp"

namespace fleet2d {

// What a straight leg from a to b [lattice units] costs, percent times lattice units; infinite
// where none leads. Each part of it counts by the cell that it runs through. `cost` is (rows,
// columns), -1 where no way leads.
f64 leg_cost(View<const i32, 2> cost, Point a, Point b);

// A way with fewer corners: legs are joined while the joint one is clear and no dearer. The points
// (n, 2) are some of those of `way`, the first and the last among them; each leg of `way` lies in
// the space of the mesh.
Array<i64, 2> pull_taut(const Mesh& mesh, View<const i32, 2> cost, View<const i64, 2> way);

}  // namespace fleet2d
