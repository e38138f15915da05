// The region visible from a point.
//
// A region is a list of pieces, counter-clockwise, each a triangle between the eye and a wall. A piece is stored
// as two numbers: the vertex that its right border runs through, and the wall edge that it ends at
// (3 * triangle + k). The piece's left border is the right border of the next piece, so every direction belongs
// to exactly one piece. Coordinates appear only when a region is measured or drawn.
//
// The method is triangular expansion (Bungiu, Hemmer et al. 2014, arXiv 1403.3905): start with the triangle of
// the eye and look through its edges; a cone of sight that enters a triangle is split by the apex of that
// triangle if the apex lies strictly inside the cone. Every vertex that is visible splits a cone, and no other
// does, so the pieces don't depend on the triangulation.
#pragma once

#include "line_of_sight.hpp"

namespace fleet2d {

// The pieces that are seen from a point, counter-clockwise.
struct Pieces {
    View<const i32> right;  // (n,) the vertex on each piece's right border
    View<const i32> wall;   // (n,) the wall edge, 3 * triangle + k, at which each piece ends

    i64 count() const { return right.size(); }
    // The vertex on the left border of piece i: that on the right border of the next.
    i32 left(i64 i) const { return right[i + 1 < count() ? i + 1 : 0]; }
};

// A wall edge: the line from one vertex to another, with the free space on its left.
struct WallLine {
    Point start, end;
};

inline WallLine wall_line(const Mesh& mesh, i64 wall) {
    const i64 triangle = wall / 3, k = wall - 3 * triangle;
    return {mesh.vertex(mesh.corner(triangle, k)), mesh.vertex(mesh.corner(triangle, following_edge(k)))};
}

// The vector to a vertex from (x, y).
inline Point towards_vertex(const Mesh& mesh, i64 vertex, i64 x, i64 y) {
    const Point at = mesh.vertex(vertex);
    return {at.x - x, at.y - y};
}

// Finds the pieces that are seen from a point, and holds them until the next call. Create one for each thread and
// mesh.
class Lookout {
public:
    explicit Lookout(const Mesh& mesh);

    // The pieces seen from (x, y), beginning anywhere; none for an eye outside or on a wall. `triangle` holds the
    // eye (see locate); OUTSIDE is allowed.
    Pieces look_around(const Mesh& mesh, i64 x, i64 y, i64 triangle);

private:
    Array<i32> right_;
    Scratch scratch_;  // its `wall` holds the walls of the pieces
};

// The region visible from a point.
struct Region {
    i64 x, y;       // the eye, lattice units
    Pieces pieces;  // beginning with the one whose right border has the smallest angle in [0, one turn)
};

// The pieces of many regions, one region after the other.
struct PieceLists {
    Array<i64> start;  // (regions + 1,) where the pieces of each region begin
    Array<i32> right;  // as in Pieces
    Array<i32> wall;
};

// The region visible from (x, y); no pieces for an eye outside or on a wall.
PieceLists visible_region(const Mesh& mesh, i64 x, i64 y);

// The regions visible from the centres of many cells.
//
// `cells` is (n, 2), row and column of each; `cell_triangles` is (rows, columns), as from rasterize_cells.
PieceLists regions_of_cells(const Mesh& mesh, View<const i64, 2> cells, View<const i32, 2> cell_triangles);

// Whether p is in a region, as by a line of sight.
bool region_contains(const Mesh& mesh, const Region& region, i64 px, i64 py);

struct Outline {
    Array<f64, 2> corners;  // (2 n, 2) for each piece the ends of its wall, right before left, lattice units
    f64 area = 0;           // square lattice units
};

// Measure a region, and list the corners of its outline.
Outline region_outline(const Mesh& mesh, const Region& region);

}  // namespace fleet2d
