#include "line_of_sight.hpp"

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "lattice.hpp"

namespace fleet2d {
namespace {

// Whether q + d comes before the corner of the triangle that the ray from q along d hits.
bool is_before_corner(const Mesh& mesh, i64 triangle, i64 qx, i64 qy, i64 dx, i64 dy) {
    for (i64 k = 0; k < 3; ++k) {
        const Point corner = mesh.vertex(mesh.corner(triangle, k));
        const i64 vx = corner.x - qx, vy = corner.y - qy;
        if (dx * vy - dy * vx == 0 && dx * vx + dy * vy > 0) {
            return dx * dx + dy * dy < vx * vx + vy * vy;
        }
    }
    return false;
}

// Vertices are seen once each, unless triangles round one of them overlap.
void check_room(i64 count, View<const i32> seen) {
    if (count == seen.size()) throw std::invalid_argument("triangles of the mesh overlap");
}

}  // namespace

bool line_of_sight(const Mesh& mesh, i64 qx, i64 qy, i64 triangle, i64 px, i64 py) {
    if (triangle == OUTSIDE || on_wall(mesh, triangle, qx, qy)) return false;
    const i64 dx = px - qx, dy = py - qy;
    if (dx == 0 && dy == 0) return true;
    const i64 a = mesh.corner(triangle, 0), b = mesh.corner(triangle, 1), c = mesh.corner(triangle, 2);
    // Which side of the ray a vertex is on: positive is left.
    const auto side_of = [&](i64 id) {
        const Point v = mesh.vertex(id);
        return dx * (v.y - qy) - dy * (v.x - qx);
    };
    const i64 side_a = side_of(a), side_b = side_of(b), side_c = side_of(c);
    i64 leaving, right, left;
    if (side_a < 0 && 0 < side_b) {
        leaving = 0, right = a, left = b;
    } else if (side_b < 0 && 0 < side_c) {
        leaving = 1, right = b, left = c;
    } else if (side_c < 0 && 0 < side_a) {
        leaving = 2, right = c, left = a;
    } else {
        return is_before_corner(mesh, triangle, qx, qy, dx, dy);
    }
    for (;;) {
        const Point r = mesh.vertex(right), l = mesh.vertex(left);
        if (orient(r.x, r.y, l.x, l.y, px, py) > 0) return true;
        const i64 next = mesh.neighbor(triangle, leaving);
        if (next == WALL) return false;
        const i64 entry = entry_edge(mesh, next, triangle);
        const i64 apex = mesh.corner(next, previous_edge(entry));
        const Point v = mesh.vertex(apex);
        const i64 ax = v.x - qx, ay = v.y - qy;
        const i64 side = dx * ay - dy * ax;
        if (side > 0) {
            leaving = following_edge(entry), left = apex;
        } else if (side < 0) {
            leaving = previous_edge(entry), right = apex;
        } else {
            return dx * dx + dy * dy < ax * ax + ay * ay;
        }
        triangle = next;
    }
}

i64 look_through(const Mesh& mesh, i64 x, i64 y, i64 triangle, i64 edge, View<i32> right, View<i32> wall, i64 count,
                 View<i32, 2> stack) {
    stack(0, 0) = static_cast<i32>(3 * triangle + edge);
    stack(0, 1) = mesh.triangles(triangle, edge);
    stack(0, 2) = mesh.triangles(triangle, following_edge(edge));
    i64 waiting = 1;
    while (waiting > 0) {
        --waiting;
        // The cone of sight between two vertices, as far as the edge `seen`.
        i32 seen = stack(waiting, 0);
        const i32 cone_right = stack(waiting, 1);
        i32 cone_left = stack(waiting, 2);
        const i64 rx = mesh.vertices(cone_right, 0) - x, ry = mesh.vertices(cone_right, 1) - y;
        i64 lx = mesh.vertices(cone_left, 0) - x, ly = mesh.vertices(cone_left, 1) - y;
        for (;;) {
            const Beyond& beyond = mesh.beyond[seen];
            if (beyond.apex == WALL) break;
            const i64 ox = beyond.x - x, oy = beyond.y - y;
            if (rx * oy - ry * ox <= 0) {  // the apex is to the right of the cone, or on its border
                seen = beyond.left;
                continue;
            }
            if (lx * oy - ly * ox < 0) {  // it is inside: the cone is split, and its left part waits
                stack(waiting, 0) = beyond.left;
                stack(waiting, 1) = beyond.apex;
                stack(waiting, 2) = cone_left;
                ++waiting;
                cone_left = beyond.apex, lx = ox, ly = oy;
            }
            seen = beyond.right;
        }
        check_room(count, right);
        right[count] = cone_right;
        wall[count] = seen;
        ++count;
    }
    return count;
}

Fans build_fans(const Mesh& mesh) {
    const i64 vertices = mesh.vertex_count();
    Fans fans;
    fans.start = Array<i32>::zeros({vertices + 1});
    for (i64 triangle = 0; triangle < mesh.triangle_count(); ++triangle) {
        for (i64 k = 0; k < 3; ++k) ++fans.start[mesh.corner(triangle, k) + 1];
    }
    std::vector<i32> next(static_cast<std::size_t>(vertices));
    for (i64 vertex = 0; vertex < vertices; ++vertex) {
        next[static_cast<std::size_t>(vertex)] = fans.start[vertex];
        fans.start[vertex + 1] += fans.start[vertex];
    }
    fans.triangles = Array<i32>::empty({fans.start[vertices]});
    for (i64 triangle = 0; triangle < mesh.triangle_count(); ++triangle) {
        for (i64 k = 0; k < 3; ++k) {
            fans.triangles[next[static_cast<std::size_t>(mesh.corner(triangle, k))]++] = static_cast<i32>(triangle);
        }
    }
    return fans;
}

i64 vertices_seen_from_point(const Mesh& mesh, i64 x, i64 y, i64 triangle, View<i32> seen, Scratch& scratch) {
    if (triangle == OUTSIDE) return 0;
    for (i64 k = 0; k < 3; ++k) {
        const i64 vertex = mesh.corner(triangle, k);
        if (mesh.vertices(vertex, 0) == x && mesh.vertices(vertex, 1) == y) {
            seen[0] = static_cast<i32>(vertex);
            return 1;
        }
    }
    i64 count = 0;
    for (i64 k = 0; k < 3; ++k) {
        const Point a = mesh.vertex(mesh.corner(triangle, k));
        const Point b = mesh.vertex(mesh.corner(triangle, following_edge(k)));
        if (orient(a.x, a.y, b.x, b.y, x, y) == 0 && mesh.neighbor(triangle, k) == WALL) {
            seen[count++] = mesh.triangles(triangle, k);
        } else {
            count = look_through(mesh, x, y, triangle, k, seen, scratch.wall, count, scratch.stack);
        }
    }
    return count;
}

i64 vertices_seen_from_vertex(const Mesh& mesh, const Fans& fans, i64 vertex, View<i32> seen, Scratch& scratch) {
    const Point at = mesh.vertex(vertex);
    i64 count = 0;
    for (i64 i = fans.start[vertex]; i < fans.start[vertex + 1]; ++i) {
        const i64 triangle = fans.triangles[i];
        i64 corner = 0;
        while (mesh.corner(triangle, corner) != vertex) ++corner;
        count =
            look_through(mesh, at.x, at.y, triangle, following_edge(corner), seen, scratch.wall, count, scratch.stack);
        const i64 last = previous_edge(corner);
        if (mesh.neighbor(triangle, last) == WALL) {
            check_room(count, seen);
            seen[count++] = mesh.triangles(triangle, last);
        }
    }
    return count;
}

Array<i64, 2> nearest_cells_in_sight(const Mesh& mesh, View<const bool, 2> cells, i64 x, i64 y, i64 reach, i64 most,
                                     i64 wanted) {
    const auto [rows, columns] = cells.shape;
    const auto first = [](i64 least) { return std::max(floor_div(least, SUB), i64{0}); };
    const auto end = [](i64 greatest, i64 count) { return std::min(floor_div(greatest, SUB) + 1, count); };
    using Candidate = std::pair<i64, i64>;  // squared distance, and the cell's number
    std::vector<Candidate> queue;
    for (i64 row = first(y - reach); row < end(y + reach, rows); ++row) {
        for (i64 column = first(x - reach); column < end(x + reach, columns); ++column) {
            if (!cells(row, column)) continue;
            const i64 dx = column * SUB + CELL_CENTRE - x, dy = row * SUB + CELL_CENTRE - y;
            if (dx * dx + dy * dy <= reach * reach) queue.emplace_back(dx * dx + dy * dy, row * columns + column);
        }
    }
    std::ranges::make_heap(queue, std::greater());
    const i64 triangle = locate(mesh, x, y);
    auto found = Array<i64, 2>::empty({wanted, 2});
    i64 count = 0;
    for (i64 tried = 0; tried < most && count < wanted && !queue.empty(); ++tried) {
        std::ranges::pop_heap(queue, std::greater());
        const i64 row = queue.back().second / columns, column = queue.back().second % columns;
        queue.pop_back();
        const i64 px = column * SUB + CELL_CENTRE, py = row * SUB + CELL_CENTRE;
        if (!line_of_sight(mesh, x, y, triangle, px, py)) continue;
        found(count, 0) = row;
        found(count++, 1) = column;
    }
    found.truncate(count);
    return found;
}

}  // namespace fleet2d
