#include "region.hpp"

#include <algorithm>

namespace fleet2d {
namespace {

constexpr i64 EXPECTED_PIECES = 32;  // room that is made for each region; lists grow beyond

// 0 for a direction in [0, half a turn), 1 for one in [half a turn, a full turn).
int half_of_turn(i64 dx, i64 dy) { return dy > 0 || (dy == 0 && dx > 0) ? 0 : 1; }

// Whether a coordinate is one that a mesh can have. Whoever is further out is in no region.
bool is_on_lattice(i64 coordinate) { return 0 <= coordinate && coordinate <= LIMIT; }

// The piece whose right border has the smallest angle in [0, one turn) from the x axis.
i64 first_by_angle(const Mesh& mesh, i64 x, i64 y, const Pieces& pieces) {
    if (pieces.count() == 0) return 0;
    const auto half_of_border = [&](i64 i) {
        const Point border = towards_vertex(mesh, pieces.right[i], x, y);
        return half_of_turn(border.x, border.y);
    };
    // No piece is as wide as half a turn, so right borders lie in both halves of the turn.
    int before = half_of_border(pieces.count() - 1);
    for (i64 i = 0; i < pieces.count(); ++i) {
        const int half = half_of_border(i);
        if (half < before) return i;
        before = half;
    }
    return 0;
}

// Write the pieces to `lists` from `used` on, beginning with the first by angle; how much is used then.
i64 append_region(const Mesh& mesh, i64 x, i64 y, const Pieces& pieces, PieceLists& lists, i64 used) {
    const i64 first = first_by_angle(mesh, x, y, pieces);
    lists.right.grow(used + pieces.count(), used);
    lists.wall.grow(used + pieces.count(), used);
    const View<const i32>&right = pieces.right, &wall = pieces.wall;
    std::rotate_copy(right.begin(), right.begin() + first, right.end(), lists.right.data() + used);
    std::rotate_copy(wall.begin(), wall.begin() + first, wall.end(), lists.wall.data() + used);
    return used + pieces.count();
}

PieceLists room_for_regions(i64 regions, i64 pieces) {
    return {Array<i64>::zeros({regions + 1}), Array<i32>::empty({pieces}), Array<i32>::empty({pieces})};
}

// The last piece whose right border is at or before a direction; the last of all if each is behind it.
i64 piece_in_direction(const Mesh& mesh, const Region& region, i64 dx, i64 dy) {
    const int half = half_of_turn(dx, dy);
    i64 low = -1, high = region.pieces.count();
    while (high - low > 1) {
        const i64 middle = (low + high) / 2;
        const Point border = towards_vertex(mesh, region.pieces.right[middle], region.x, region.y);
        const int half_of_border = half_of_turn(border.x, border.y);
        if (half_of_border < half || (half_of_border == half && border.x * dy - border.y * dx >= 0)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low >= 0 ? low : region.pieces.count() - 1;
}

}  // namespace

Lookout::Lookout(const Mesh& mesh) : right_(Array<i32>::empty({mesh.vertex_count() + 4})), scratch_(mesh) {}

Pieces Lookout::look_around(const Mesh& mesh, i64 x, i64 y, i64 triangle) {
    i64 count = 0;
    if (triangle != OUTSIDE && !on_wall(mesh, triangle, x, y)) {
        for (i64 k = 0; k < 3; ++k) {
            count = look_through(mesh, x, y, triangle, k, right_, scratch_.wall, count, scratch_.stack);
        }
    }
    return {right_.view().slice(0, count), scratch_.wall.view().slice(0, count)};
}

PieceLists visible_region(const Mesh& mesh, i64 x, i64 y) {
    Lookout lookout(mesh);
    const Pieces pieces = lookout.look_around(mesh, x, y, locate(mesh, x, y));
    PieceLists lists = room_for_regions(1, pieces.count());
    lists.start[1] = append_region(mesh, x, y, pieces, lists, 0);
    return lists;
}

PieceLists regions_of_cells(const Mesh& mesh, View<const i64, 2> cells, View<const i32, 2> cell_triangles) {
    PieceLists lists = room_for_regions(cells.size(), EXPECTED_PIECES * cells.size());
    Lookout lookout(mesh);
    i64 used = 0;
    for (i64 i = 0; i < cells.size(); ++i) {
        const i64 row = cells(i, 0), column = cells(i, 1);
        const i64 x = column * SUB + CELL_CENTRE, y = row * SUB + CELL_CENTRE;
        const Pieces pieces = lookout.look_around(mesh, x, y, cell_triangles(row, column));
        used = append_region(mesh, x, y, pieces, lists, used);
        lists.start[i + 1] = used;
    }
    lists.right.truncate(used);
    lists.wall.truncate(used);
    return lists;
}

bool region_contains(const Mesh& mesh, const Region& region, i64 px, i64 py) {
    if (region.pieces.count() == 0 || !is_on_lattice(px) || !is_on_lattice(py)) return false;
    const i64 dx = px - region.x, dy = py - region.y;
    if (dx == 0 && dy == 0) return true;
    const i64 piece = piece_in_direction(mesh, region, dx, dy);
    const Point corner = towards_vertex(mesh, region.pieces.right[piece], region.x, region.y);
    if (corner.x * dy - corner.y * dx == 0 && corner.x * dx + corner.y * dy > 0) {
        // Exactly in line with a corner: visible only in front of it.
        return dx * dx + dy * dy < corner.x * corner.x + corner.y * corner.y;
    }
    const WallLine wall = wall_line(mesh, region.pieces.wall[piece]);
    return orient(wall.start.x, wall.start.y, wall.end.x, wall.end.y, px, py) > 0;
}

Outline region_outline(const Mesh& mesh, const Region& region) {
    const i64 x = region.x, y = region.y, count = region.pieces.count();
    const auto eye_x = static_cast<f64>(x), eye_y = static_cast<f64>(y);
    Outline outline{Array<f64, 2>::empty({2 * count, 2})};
    const View<f64, 2> corners = outline.corners;
    f64 doubled_area = 0;
    for (i64 i = 0; i < count; ++i) {
        const Point right = towards_vertex(mesh, region.pieces.right[i], x, y);
        const Point left = towards_vertex(mesh, region.pieces.left(i), x, y);
        const WallLine wall = wall_line(mesh, region.pieces.wall[i]);
        const i64 run = wall.end.x - wall.start.x, rise = wall.end.y - wall.start.y;
        // How far the wall is along each border, as a multiple of the distance to the border's vertex:
        // exactly 1 where the vertex is an end of the wall.
        const auto across = static_cast<f64>((wall.start.x - x) * rise - (wall.start.y - y) * run);
        const f64 reach_right = across / static_cast<f64>(right.x * rise - right.y * run);
        const f64 reach_left = across / static_cast<f64>(left.x * rise - left.y * run);
        corners(2 * i, 0) = eye_x + reach_right * static_cast<f64>(right.x);
        corners(2 * i, 1) = eye_y + reach_right * static_cast<f64>(right.y);
        corners(2 * i + 1, 0) = eye_x + reach_left * static_cast<f64>(left.x);
        corners(2 * i + 1, 1) = eye_y + reach_left * static_cast<f64>(left.y);
        doubled_area += static_cast<f64>(right.x * left.y - right.y * left.x) * (reach_right * reach_left);
    }
    outline.area = doubled_area / 2;
    return outline;
}

}  // namespace fleet2d
