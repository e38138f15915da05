#include "../region.hpp"

#include "mesh.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

using Indices = View<const i32>;

Region checked_region(const Mesh& mesh, i64 x, i64 y, Indices right, Indices wall) {
    require(right.size() == wall.size(), "right and wall must have one length, that of the pieces");
    require(all_in_range(right, 0, mesh.vertex_count()), "right must hold numbers of vertices");
    require(all_in_range(wall, 0, 3 * mesh.triangle_count()), "wall must hold edges, 3 * triangle + k");
    require(right.size() == 0 || (0 <= x && x <= LIMIT && 0 <= y && y <= LIMIT),
            "a region that has pieces is that of an eye at 0 to 2**20");
    return {x, y, {right, wall}};
}

void check_cells(const Mesh& mesh, View<const i64, 2> cells, View<const i32, 2> cell_triangles) {
    require(cells.shape[1] == 2, "cells must be (n, 2), rows and columns");
    const i64 rows = cell_triangles.shape[0], columns = cell_triangles.shape[1];
    for (i64 i = 0; i < cells.size(); ++i) {
        const i64 row = cells(i, 0), column = cells(i, 1);
        require(0 <= row && row < rows && 0 <= column && column < columns, "cells must lie in cell_triangles");
        const i64 triangle = cell_triangles(row, column);
        require(triangle == OUTSIDE ||
                    (0 <= triangle && triangle < mesh.triangle_count() &&
                     contains_triangle(mesh, triangle, column * SUB + CELL_CENTRE, row * SUB + CELL_CENTRE)),
                "cell_triangles must hold the triangle of each cell's centre, or -1");
    }
}

}  // namespace

void bind_region(nb::module_& m) {
    m.def(
        "visible_region",
        [](const Mesh& mesh, i64 x, i64 y) {
            PieceLists found = visible_region(mesh, x, y);
            return std::tuple(std::move(found.right), std::move(found.wall));
        },
        "mesh"_a, "x"_a, "y"_a, Unlocked(),
        R"(Compute the region visible from a point.

The pieces come counter-clockwise, the first is the one whose right border has the smallest angle in
[0, one turn) from the x axis.

Args:
    mesh: Free space.
    x: Position of the eye [lattice units].
    y: Position of the eye [lattice units].

Returns:
    `right` int32 (n,), the vertex on each piece's right border, and `wall` int32 (n,), the wall
    edge, 3 * triangle + k, at which each piece ends; empty for an eye outside or on a wall.)");
    m.def(
        "region_contains",
        [](const Mesh& mesh, i64 x, i64 y, Indices right, Indices wall, i64 px, i64 py) {
            return region_contains(mesh, checked_region(mesh, x, y, right, wall), px, py);
        },
        "mesh"_a, "x"_a, "y"_a, "right"_a, "wall"_a, "px"_a, "py"_a,
        R"(Return whether p is in the region of (x, y), as by a line of sight.

Args:
    mesh: Free space.
    x: Position of the eye [lattice units].
    y: Position of the eye [lattice units].
    right: int32 (n,), the vertex on the right border of each of the region's pieces.
    wall: int32 (n,), the wall edge of each piece.
    px: The point, lattice units.
    py: The point, lattice units.)");
    m.def(
        "region_contains_points",
        [](const Mesh& mesh, i64 x, i64 y, Indices right, Indices wall, View<const i64, 2> points) {
            require(points.shape[1] == 2, "points must be (n, 2)");
            const Region region = checked_region(mesh, x, y, right, wall);
            auto inside = Array<bool>::empty({points.size()});
            for (i64 i = 0; i < points.size(); ++i) {
                inside[i] = region_contains(mesh, region, points(i, 0), points(i, 1));
            }
            return inside;
        },
        "mesh"_a, "x"_a, "y"_a, "right"_a, "wall"_a, "points"_a, Unlocked(),
        R"(Return which points are in the region of (x, y): bool (n,).

Args:
    mesh: Free space.
    x: Position of the eye [lattice units].
    y: Position of the eye [lattice units].
    right: int32 (pieces,), as from `visible_region`.
    wall: int32 (pieces,).
    points: int64 (n, 2), lattice units.)");
    m.def(
        "regions_of_cells",
        [](const Mesh& mesh, View<const i64, 2> cells, View<const i32, 2> cell_triangles) {
            check_cells(mesh, cells, cell_triangles);
            PieceLists lists = regions_of_cells(mesh, cells, cell_triangles);
            return std::tuple(std::move(lists.start), std::move(lists.right), std::move(lists.wall));
        },
        "mesh"_a, "cells"_a, "cell_triangles"_a, Unlocked(),
        R"(Find the regions visible from the centres of many cells.

Args:
    mesh: Free space.
    cells: int64 (n, 2), row and column of each cell.
    cell_triangles: int32 (rows, columns), from `rasterize_cells`.

Returns:
    `start` int64 (n + 1,), `right` int32, `wall` int32: the pieces of cell i are
    `right[start[i]:start[i + 1]]` and `wall[start[i]:start[i + 1]]`, as from `visible_region`.)");
    m.def(
        "region_outline",
        [](const Mesh& mesh, i64 x, i64 y, Indices right, Indices wall) {
            Outline outline = region_outline(mesh, checked_region(mesh, x, y, right, wall));
            return std::tuple(std::move(outline.corners), outline.area);
        },
        "mesh"_a, "x"_a, "y"_a, "right"_a, "wall"_a, Unlocked(),
        R"(Measure a region, and list the corners of its outline.

Args:
    mesh: Free space.
    x: Position of the eye [lattice units].
    y: Position of the eye [lattice units].
    right: int32 (n,), as from `visible_region`.
    wall: int32 (n,).

Returns:
    For each piece the ends of its wall, right before left, float64 (2 n, 2), lattice units; and
    the area, square lattice units.)");
}

}  // namespace fleet2d
