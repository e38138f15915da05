#include "mesh.hpp"

#include "../line_of_sight.hpp"
#include "subjects.hpp"

namespace fleet2d {

OwnedMesh::OwnedMesh(View<const i64, 2> vertices, View<const i32, 2> triangles, View<const i32, 2> neighbors) {
    require(vertices.shape[1] == 2, "vertices must be (n, 2)");
    require(triangles.shape[1] == 3 && neighbors.shape[1] == 3 && triangles.size() == neighbors.size(),
            "triangles and neighbors must be (t, 3), both of one length");
    require(all_in_range(vertices, 0, LIMIT + 1), "vertices must be in 0 to 2**20");
    require(all_in_range(triangles, 0, vertices.size()), "triangles must hold numbers of vertices");
    require(all_in_range(neighbors, WALL, triangles.size()), "neighbors must hold numbers of triangles, or -1");
    for (i64 i = 0; i < triangles.size(); ++i) {
        i64 xy[6];
        for (i64 k = 0; k < 3; ++k) {
            xy[2 * k] = vertices(triangles(i, k), 0);
            xy[2 * k + 1] = vertices(triangles(i, k), 1);
            const i64 other = neighbors(i, k);
            bool mutual = other == WALL;
            for (i64 j = 0; j < 3 && !mutual; ++j) {
                mutual = neighbors(other, j) == i && triangles(other, j) == triangles(i, following_edge(k)) &&
                         triangles(other, following_edge(j)) == triangles(i, k);
            }
            require(mutual, "a triangle and its neighbor must share an edge, and be each other's neighbor there");
        }
        require(orient(xy[0], xy[1], xy[2], xy[3], xy[4], xy[5]) > 0, "triangles must be counter-clockwise");
    }
    vertices_ = Array<i64, 2>::copy_of(vertices);
    triangles_ = Array<i32, 2>::copy_of(triangles);
    neighbors_ = Array<i32, 2>::copy_of(neighbors);
    buckets_ = build_buckets(vertices_, triangles_);
    mesh_ = {vertices_,          triangles_,       neighbors_,    buckets_.start,
             buckets_.triangles, buckets_.columns, buckets_.rows, {}};
    beyond_ = build_beyond(mesh_);
    mesh_.beyond = beyond_;
}

namespace {

// What `__getstate__` returns, and `__init__` takes.
auto arrays_of(nb::handle self) {
    const Mesh& mesh = nb::cast<const OwnedMesh&>(self).mesh();
    return nb::make_tuple(border::borrowed(mesh.vertices, self), border::borrowed(mesh.triangles, self),
                          border::borrowed(mesh.neighbors, self));
}

template <auto Member>
auto array_of_mesh() {
    return [](nb::handle self) { return border::borrowed(nb::cast<const OwnedMesh&>(self).mesh().*Member, self); };
}

}  // namespace

void bind_mesh(nb::module_& m) {
    m.attr("SUB") = SUB;
    m.attr("CELL_CENTRE") = CELL_CENTRE;
    m.attr("BUCKET") = BUCKET;
    m.attr("OUTSIDE") = OUTSIDE;
    m.attr("WALL") = WALL;

    using Vertices = View<const i64, 2>;
    using Triangles = View<const i32, 2>;
    nb::class_<OwnedMesh>(m, "Mesh", R"(A triangulation of free space without extra points; it never changes.

It may have holes and several components.

Args:
    vertices: int64 (n, 2), lattice units, sorted by (x, y), so numbers don't depend on the triangles.
    triangles: int32 (t, 3), numbers of vertices, counter-clockwise.
    neighbors: int32 (t, 3), the triangle across edge k (vertex k to vertex k + 1), -1 for a wall.

Raises:
    ValueError: An array has another shape, or a number in it is none of a vertex or triangle.)")
        .def(nb::init<Vertices, Triangles, Triangles>(), "vertices"_a, "triangles"_a, "neighbors"_a)
        .def_prop_ro("vertices", array_of_mesh<&Mesh::vertices>(), "int64 (n, 2), lattice units, sorted by (x, y).")
        .def_prop_ro("triangles", array_of_mesh<&Mesh::triangles>(),
                     "int32 (t, 3), numbers of vertices, counter-clockwise.")
        .def_prop_ro("neighbors", array_of_mesh<&Mesh::neighbors>(),
                     "int32 (t, 3), the triangle across edge k (vertex k to vertex k + 1), -1 for a wall.")
        .def_prop_ro("bucket_start", array_of_mesh<&Mesh::bucket_start>(),
                     "int32 (rows * columns + 1,), where each square bucket begins in `bucket_triangles`.")
        .def_prop_ro("bucket_triangles", array_of_mesh<&Mesh::bucket_triangles>(),
                     "int32, the triangles that overlap each square bucket, ascending.")
        .def_prop_ro(
            "bucket_columns", [](const OwnedMesh& self) { return self.mesh().bucket_columns; },
            "Number of buckets along x.")
        .def_prop_ro(
            "bucket_rows", [](const OwnedMesh& self) { return self.mesh().bucket_rows; }, "Number of buckets along y.")
        .def(
            "with_neighbors",
            [](const OwnedMesh& self, Triangles neighbors) {
                return OwnedMesh(self.mesh().vertices, self.mesh().triangles, neighbors);
            },
            "neighbors"_a, "Return the mesh with other walls: `neighbors` as for the class.")
        .def("__getstate__", &arrays_of, nb::sig("def __getstate__(self) -> tuple[typing.Any, ...]"))
        .def("__setstate__", [](OwnedMesh& self, std::tuple<Vertices, Triangles, Triangles> state) {
            new (&self) OwnedMesh(std::get<0>(state), std::get<1>(state), std::get<2>(state));
        });

    m.def("locate", &locate, "mesh"_a, "x"_a, "y"_a,
          "Return the lowest triangle that holds the point (borders included), or -1 outside.");
    m.def("orient", &orient, "ax"_a, "ay"_a, "bx"_a, "by"_a, "cx"_a, "cy"_a,
          "Return twice the signed area of (a, b, c): positive when c lies left of the line from a to b.");
    m.def(
        "contains_triangle",
        [](const Mesh& mesh, i64 triangle, i64 x, i64 y) {
            require(0 <= triangle && triangle < mesh.triangle_count(), "there is no such triangle");
            return contains_triangle(mesh, triangle, x, y);
        },
        "mesh"_a, "triangle"_a, "x"_a, "y"_a, "Return whether the closed triangle holds the point.");
    m.def("strictly_inside", &strictly_inside, "mesh"_a, "x"_a, "y"_a,
          "Return whether the point lies in free space and on no wall.");
    m.def("rasterize_cells", &rasterize_cells, "mesh"_a, "rows"_a, "columns"_a, Unlocked(),
          R"(Return the triangle of every cell centre that lies strictly inside free space.

Returns:
    int32 (rows, columns): the lowest triangle that holds the centre; -1 for a centre outside or
    on a wall.)");
    m.def(
        "label_triangles",
        [](View<const i32, 2> neighbors) {
            require(neighbors.shape[1] == 3 && all_in_range(neighbors, WALL, neighbors.size()),
                    "neighbors must be (t, 3), numbers of triangles or -1");
            return label_triangles(neighbors);
        },
        "neighbors"_a, "Number the connected parts of a mesh; returns each triangle's part, int32 (triangles,).");
}

}  // namespace fleet2d
