#include "line_of_sight.hpp"

#include "../line_of_sight.hpp"
#include "mesh.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

bool sees_from_triangle(const Mesh& mesh, i64 qx, i64 qy, i64 triangle, i64 px, i64 py) {
    check_point(qx, qy);
    check_point(px, py);
    require(triangle == OUTSIDE ||
                (0 <= triangle && triangle < mesh.triangle_count() && contains_triangle(mesh, triangle, qx, qy)),
            "triangle must be one that holds the point q, or -1");
    return line_of_sight(mesh, qx, qy, triangle, px, py);
}

bool sees(const Mesh& mesh, i64 qx, i64 qy, i64 px, i64 py) {
    check_point(px, py);
    return line_of_sight(mesh, qx, qy, locate(mesh, qx, qy), px, py);
}

}  // namespace

void bind_line_of_sight(nb::module_& m) {
    m.def("line_of_sight", &sees_from_triangle, "mesh"_a, "qx"_a, "qy"_a, "triangle"_a, "px"_a, "py"_a,
          R"(Return whether p is visible from q: the segment between them touches no wall point.

A point outside or on a wall sees nothing and isn't seen.

Args:
    mesh: Free space.
    qx: Position of the eye [lattice units].
    qy: Position of the eye [lattice units].
    triangle: A triangle that holds q, from `locate`; -1 is allowed.
    px: Position of the point [lattice units].
    py: Position of the point [lattice units].)");
    m.def("line_of_sight", &sees, "mesh"_a, "qx"_a, "qy"_a, "px"_a, "py"_a,
          "Return whether p is visible from q, wherever q is; see the other form.");
    m.def(
        "nearest_cells_in_sight",
        [](const Mesh& mesh, View<const bool, 2> cells, i64 x, i64 y, i64 reach, i64 most, i64 wanted) {
            constexpr i64 limit = i64{1} << 20;
            check_point(x, y);
            require(cells.shape[0] <= limit && cells.shape[1] <= limit,
                    "cells must have at most 2**20 rows and columns");
            require(0 <= reach && reach <= limit, "reach must be in 0 to 2**20");
            require(0 <= wanted && wanted <= most && most <= limit, "wanted must be in 0 to most, that at most 2**20");
            return nearest_cells_in_sight(mesh, cells, x, y, reach, most, wanted);
        },
        "mesh"_a, "cells"_a, "x"_a, "y"_a, "reach"_a, "most"_a, "wanted"_a, Unlocked(),
        R"(Return the cells of a mask whose centres are visible from a point, nearest first.

Args:
    mesh: Free space.
    cells: The mask, bool (rows, columns).
    x: The point [lattice units].
    y: The point [lattice units].
    reach: Largest distance of a centre from it [lattice units].
    most: So many of the nearest cells are looked at.
    wanted: So many are returned at most.

Returns:
    Rows and columns, int64 (n, 2); of equally near cells the first in the mask comes first.)");
    m.def(
        "build_fans",
        [](const Mesh& mesh) {
            Fans fans = build_fans(mesh);
            return std::tuple(std::move(fans.start), std::move(fans.triangles));
        },
        "mesh"_a, Unlocked(), R"(List the triangles around each vertex.

Returns:
    int32 (vertices + 1,), where the triangles of each vertex begin in the list; and the list,
    int32, ascending for each vertex.)");
    m.def(
        "vertices_seen_from_point",
        [](const Mesh& mesh, i64 x, i64 y) {
            Scratch scratch(mesh);
            auto seen = Array<i32>::empty({mesh.vertex_count() + 4});
            seen.truncate(vertices_seen_from_point(mesh, x, y, locate(mesh, x, y), seen, scratch));
            return seen;
        },
        "mesh"_a, "x"_a, "y"_a, Unlocked(), R"(Return the vertices visible from a point.

The segment between the point and the vertex touches no wall and no other vertex. A point on a wall
also sees the ends of that wall. A point at a vertex sees only that vertex.

Args:
    mesh: Free space.
    x: The point, lattice units.
    y: The point, lattice units.

Returns:
    int32 (n,), in no particular order, each once; none from a point outside.)");
    m.def(
        "vertices_seen_from_vertex",
        [](const Mesh& mesh, i64 vertex) {
            require(0 <= vertex && vertex < mesh.vertex_count(), "there is no such vertex");
            Scratch scratch(mesh);
            auto seen = Array<i32>::empty({mesh.vertex_count() + 4});
            seen.truncate(vertices_seen_from_vertex(mesh, build_fans(mesh), vertex, seen, scratch));
            return seen;
        },
        "mesh"_a, "vertex"_a, Unlocked(), R"(Return the vertices visible from a vertex.

The segment between the two touches no wall and no other vertex, or it runs along one wall.

Args:
    mesh: Free space.
    vertex: The vertex to start from.

Returns:
    int32 (n,), in no particular order, each once.)");
}

}  // namespace fleet2d
