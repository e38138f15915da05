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
