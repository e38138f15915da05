// Sight lines, by the strict rule: a sight line touches no wall, not even a corner.
//
// All of it is integer arithmetic on the mesh of free space, so verdicts are exact and symmetric,
// and they don't depend on the triangulation of the free space.
#pragma once

#include "mesh.hpp"

namespace fleet2d {

// Whether p is visible from q: the segment between them touches no wall point. A point outside or
// on a wall sees nothing and isn't seen. `triangle` holds q (see locate); OUTSIDE is allowed.
bool line_of_sight(const Mesh& mesh, i64 qx, i64 qy, i64 triangle, i64 px, i64 py);

// The cells of a mask (rows, columns) whose centres are visible from a point and at most `reach` away, (n, 2) rows and
// columns: at most `wanted` of them, nearest first and of equally near ones the first, among the `most` nearest.
Array<i64, 2> nearest_cells_in_sight(const Mesh& mesh, View<const bool, 2> cells, i64 x, i64 y, i64 reach, i64 most,
                                     i64 wanted);

// The stack of cones of sight, and scratch space for the walls that pieces end at. Create one for each
// thread and mesh.
struct Scratch {
    Array<i32> wall;      // (vertices + 4,)
    Array<i32, 2> stack;  // (vertices + 4, 3)

    explicit Scratch(const Mesh& mesh)
        : wall(Array<i32>::empty({mesh.vertex_count() + 4})),
          stack(Array<i32, 2>::empty({mesh.vertex_count() + 4, 3})) {}
};

// Append the pieces seen from (x, y) through one edge of its triangle, from right to left, to
// `right` and `wall`; the new number of pieces. `stack` is scratch space.
i64 look_through(const Mesh& mesh, i64 x, i64 y, i64 triangle, i64 edge, View<i32> right, View<i32> wall, i64 count,
                 View<i32, 2> stack);

// The triangles around each vertex.
struct Fans {
    Array<i32> start;      // (vertices + 1,) where the triangles of each vertex begin in `triangles`
    Array<i32> triangles;  // ascending for each vertex
};

Fans build_fans(const Mesh& mesh);

// The vertices visible from a point, in no particular order, each once; returns their number. The
// segment between the point and a vertex touches no wall and no other vertex. A point on
// a wall also sees the ends of that wall. A point at a vertex sees only that vertex.
// `seen` has room for vertices + 4.
i64 vertices_seen_from_point(const Mesh& mesh, i64 x, i64 y, i64 triangle, View<i32> seen, Scratch& scratch);

// The vertices visible from a vertex, in no particular order, each once; returns their number. The
// segment between the two touches no wall and no other vertex, or it runs along one wall.
i64 vertices_seen_from_vertex(const Mesh& mesh, const Fans& fans, i64 vertex, View<i32> seen, Scratch& scratch);

}  // namespace fleet2d
