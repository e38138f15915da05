// The mesh of free space: triangles between walls, and which of them holds a point.
//
// A mesh is a triangulation of the free space whose vertices are all wall vertices. Everything that
// sight and paths need follows from it by integer arithmetic. Which of the many possible
// triangulations it is never shows in a result.
#pragma once

#include "lattice.hpp"

namespace fleet2d {

inline constexpr i64 BUCKET = 256;     // side of the square buckets that find the triangle of a point, lattice units
inline constexpr i64 OUTSIDE = -1;     // the triangle of a point that lies in no triangle
inline constexpr i64 WALL = -1;        // the neighbor across an edge that is a wall
inline constexpr i64 LIMIT = 1 << 20;  // the largest coordinate: products of two differences fit in 2**42

// The edge of a triangle that follows edge k, counter-clockwise; and the one before.
constexpr i64 following_edge(i64 k) { return k < 2 ? k + 1 : 0; }
constexpr i64 previous_edge(i64 k) { return k > 0 ? k - 1 : 2; }

struct Point {
    i64 x, y;

    bool operator==(const Point&) const = default;
};

// What lies beyond an edge of a triangle: how a walk from triangle to triangle goes on. Edges are numbered
// 3 * triangle + k.
struct Beyond {
    i32 apex;         // the vertex of the triangle across the edge that isn't on the edge; WALL: none, it's a wall
    i32 x, y;         // where the apex is, lattice units
    i32 right, left;  // the edges of that triangle to the right and to the left of the apex, seen from the edge
};

// A triangulation of free space without extra points; may have holes and several components.
struct Mesh {
    View<const i64, 2> vertices;       // (n, 2) lattice units
    View<const i32, 2> triangles;      // (t, 3) vertices, counter-clockwise
    View<const i32, 2> neighbors;      // (t, 3) the triangle across edge k (vertex k to k + 1), WALL for a wall
    View<const i32> bucket_start;      // (rows * columns + 1,) where each bucket begins in bucket_triangles
    View<const i32> bucket_triangles;  // the triangles that overlap each bucket, ascending
    i64 bucket_columns = 0;
    i64 bucket_rows = 0;
    View<const Beyond> beyond;  // (3 t,) what lies beyond each edge

    i64 vertex_count() const { return vertices.size(); }
    i64 triangle_count() const { return triangles.size(); }
    Point vertex(i64 id) const { return {vertices(id, 0), vertices(id, 1)}; }
    i64 corner(i64 triangle, i64 k) const { return triangles(triangle, k); }
    i64 neighbor(i64 triangle, i64 k) const { return neighbors(triangle, k); }
};

// Which edge of `triangle` it shares with the triangle `previous`.
inline i64 entry_edge(const Mesh& mesh, i64 triangle, i64 previous) {
    if (mesh.neighbor(triangle, 0) == previous) return 0;
    return mesh.neighbor(triangle, 1) == previous ? 1 : 2;
}

// Whether the closed triangle holds the point.
inline bool contains_triangle(const Mesh& mesh, i64 triangle, i64 x, i64 y) {
    const Point a = mesh.vertex(mesh.corner(triangle, 0));
    const Point b = mesh.vertex(mesh.corner(triangle, 1));
    const Point c = mesh.vertex(mesh.corner(triangle, 2));
    return orient(a.x, a.y, b.x, b.y, x, y) >= 0 && orient(b.x, b.y, c.x, c.y, x, y) >= 0 &&
           orient(c.x, c.y, a.x, a.y, x, y) >= 0;
}

// Whether the point lies in the triangle, and not on its border.
inline bool inside_triangle(const Mesh& mesh, i64 triangle, i64 x, i64 y) {
    const Point a = mesh.vertex(mesh.corner(triangle, 0));
    const Point b = mesh.vertex(mesh.corner(triangle, 1));
    const Point c = mesh.vertex(mesh.corner(triangle, 2));
    return orient(a.x, a.y, b.x, b.y, x, y) > 0 && orient(b.x, b.y, c.x, c.y, x, y) > 0 &&
           orient(c.x, c.y, a.x, a.y, x, y) > 0;
}

// Whether a point of the closed triangle lies on a wall or at a wall's end.
inline bool on_wall(const Mesh& mesh, i64 triangle, i64 x, i64 y) {
    int edges_met = 0;
    for (i64 k = 0; k < 3; ++k) {
        const Point a = mesh.vertex(mesh.corner(triangle, k));
        const Point b = mesh.vertex(mesh.corner(triangle, following_edge(k)));
        if (orient(a.x, a.y, b.x, b.y, x, y) == 0) {
            edges_met += mesh.neighbor(triangle, k) != WALL ? 1 : 2;
        }
    }
    return edges_met > 1;
}

// The lowest triangle that holds the point (borders included), or OUTSIDE.
inline i64 locate(const Mesh& mesh, i64 x, i64 y) {
    const i64 column = floor_div(x, BUCKET), row = floor_div(y, BUCKET);
    if (column < 0 || row < 0 || column >= mesh.bucket_columns || row >= mesh.bucket_rows) {
        return OUTSIDE;
    }
    const i64 bucket = row * mesh.bucket_columns + column;
    for (i64 i = mesh.bucket_start[bucket]; i < mesh.bucket_start[bucket + 1]; ++i) {
        const i64 triangle = mesh.bucket_triangles[i];
        if (contains_triangle(mesh, triangle, x, y)) return triangle;
    }
    return OUTSIDE;
}

// Whether the point lies in free space and on no wall.
inline bool strictly_inside(const Mesh& mesh, i64 x, i64 y) {
    const i64 triangle = locate(mesh, x, y);
    return triangle != OUTSIDE && !on_wall(mesh, triangle, x, y);
}

// The triangles that overlap each square bucket.
struct Buckets {
    Array<i32> start;      // as Mesh::bucket_start
    Array<i32> triangles;  // as Mesh::bucket_triangles
    i64 columns = 0;
    i64 rows = 0;
};

Buckets build_buckets(View<const i64, 2> vertices, View<const i32, 2> triangles);

// What lies beyond each edge of a mesh: its member `beyond`, from the others.
Array<Beyond> build_beyond(const Mesh& mesh);

// The triangle of every cell centre that lies strictly inside free space, (rows, columns): the
// lowest that holds the centre; OUTSIDE for a centre outside or on a wall.
Array<i32, 2> rasterize_cells(const Mesh& mesh, i64 rows, i64 columns);

// Number the connected parts of a mesh; the part of each triangle, (triangles,).
Array<i32> label_triangles(View<const i32, 2> neighbors);

}  // namespace fleet2d
