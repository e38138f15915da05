#include "mesh.hpp"

#include <algorithm>
#include <vector>

namespace fleet2d {
namespace {

struct Box {
    i64 left, bottom, right, top;
};

Box box_of(View<const i64, 2> vertices, View<const i32> corners) {
    Box box{LIMIT, LIMIT, -LIMIT, -LIMIT};
    for (i64 k = 0; k < 3; ++k) {
        const i64 x = vertices(corners[k], 0), y = vertices(corners[k], 1);
        box = {std::min(box.left, x), std::min(box.bottom, y), std::max(box.right, x), std::max(box.top, y)};
    }
    return box;
}

// Whether the bucket with corner (x, y) reaches the inner side of all three edges.
bool overlaps_bucket(View<const i64, 2> vertices, View<const i32> corners, i64 x, i64 y) {
    for (i64 k = 0; k < 3; ++k) {
        const i64 a = corners[k], b = corners[following_edge(k)];
        const i64 ax = vertices(a, 0), ay = vertices(a, 1);
        const i64 bx = vertices(b, 0), by = vertices(b, 1);
        // The bucket's corner that lies farthest to the left of the edge decides.
        const i64 far_x = by > ay ? x : x + BUCKET;
        const i64 far_y = bx > ax ? y + BUCKET : y;
        if (orient(ax, ay, bx, by, far_x, far_y) < 0) return false;
    }
    return true;
}

struct Run {
    i64 first, last;
};

// The columns of `row` whose cell centres the closed triangle holds.
Run columns_in_triangle(const Mesh& mesh, i64 triangle, i64 row, i64 columns) {
    i64 first = 0, last = columns - 1;
    const i64 y = row * SUB + CELL_CENTRE;
    for (i64 k = 0; k < 3; ++k) {
        const Point a = mesh.vertex(mesh.corner(triangle, k));
        const Point b = mesh.vertex(mesh.corner(triangle, following_edge(k)));
        const i64 run = b.x - a.x, rise = b.y - a.y;
        // Left of the edge: rise * (x - a.x) <= run * (y - a.y), with x = SUB * column + CELL_CENTRE.
        const i64 slope = SUB * rise;
        const i64 bound = run * (y - a.y) + rise * (a.x - CELL_CENTRE);
        if (rise > 0) {
            last = std::min(last, floor_div(bound, slope));
        } else if (rise < 0) {
            first = std::max(first, -floor_div(bound, -slope));
        } else if (bound < 0) {
            return {0, -1};
        }
    }
    return {first, last};
}

}  // namespace

Buckets build_buckets(View<const i64, 2> vertices, View<const i32, 2> triangles) {
    Buckets buckets;
    i64 right = 0, top = 0;
    for (i64 i = 0; i < vertices.size(); ++i) {
        right = std::max(right, vertices(i, 0));
        top = std::max(top, vertices(i, 1));
    }
    buckets.columns = right / BUCKET + 1;
    buckets.rows = top / BUCKET + 1;
    const i64 count = buckets.rows * buckets.columns;
    buckets.start = Array<i32>::zeros({count + 1});
    std::vector<i32> next(static_cast<std::size_t>(count), 0);
    for (const bool filling : {false, true}) {
        if (filling) {
            for (i64 bucket = 0; bucket < count; ++bucket) {
                buckets.start[bucket + 1] += buckets.start[bucket];
                next[static_cast<std::size_t>(bucket)] = buckets.start[bucket];
            }
            buckets.triangles = Array<i32>::empty({buckets.start[count]});
        }
        for (i64 triangle = 0; triangle < triangles.size(); ++triangle) {
            const Box box = box_of(vertices, triangles[triangle]);
            for (i64 row = box.bottom / BUCKET; row <= box.top / BUCKET; ++row) {
                for (i64 column = box.left / BUCKET; column <= box.right / BUCKET; ++column) {
                    if (!overlaps_bucket(vertices, triangles[triangle], column * BUCKET, row * BUCKET)) continue;
                    const i64 bucket = row * buckets.columns + column;
                    if (filling) {
                        buckets.triangles[next[static_cast<std::size_t>(bucket)]++] = static_cast<i32>(triangle);
                    } else {
                        ++buckets.start[bucket + 1];
                    }
                }
            }
        }
    }
    return buckets;
}

Array<Beyond> build_beyond(const Mesh& mesh) {
    auto beyond = Array<Beyond>::empty({3 * mesh.triangle_count()});
    for (i64 edge = 0; edge < beyond.size(); ++edge) {
        const i64 here = edge / 3, next = mesh.neighbor(here, edge - 3 * here);
        if (next == WALL) {
            beyond[edge] = {static_cast<i32>(WALL), 0, 0, 0, 0};
            continue;
        }
        const i64 entry = entry_edge(mesh, next, here);
        const i64 right = following_edge(entry), left = previous_edge(entry);
        const i64 apex = mesh.corner(next, left);
        const Point at = mesh.vertex(apex);
        beyond[edge] = {static_cast<i32>(apex), static_cast<i32>(at.x), static_cast<i32>(at.y),
                        static_cast<i32>(3 * next + right), static_cast<i32>(3 * next + left)};
    }
    return beyond;
}

Array<i32, 2> rasterize_cells(const Mesh& mesh, i64 rows, i64 columns) {
    auto result = Array<i32, 2>::filled({rows, columns}, static_cast<i32>(OUTSIDE));
    const View<i32, 2> cells = result;
    for (i64 triangle = 0; triangle < mesh.triangle_count(); ++triangle) {
        const Box box = box_of(mesh.vertices, mesh.triangles[triangle]);
        const i64 lowest = std::max(i64{0}, -floor_div(CELL_CENTRE - box.bottom, SUB));
        const i64 highest = std::min(rows - 1, floor_div(box.top - CELL_CENTRE, SUB));
        for (i64 row = lowest; row <= highest; ++row) {
            const Run run = columns_in_triangle(mesh, triangle, row, columns);
            const i64 y = row * SUB + CELL_CENTRE;
            for (i64 column = run.first; column <= run.last; ++column) {
                if (cells(row, column) != OUTSIDE) continue;
                // Only the ends of the run can lie on an edge.
                const bool at_end = column == run.first || column == run.last;
                if (at_end && on_wall(mesh, triangle, column * SUB + CELL_CENTRE, y)) continue;
                cells(row, column) = static_cast<i32>(triangle);
            }
        }
    }
    return result;
}

Array<i32> label_triangles(View<const i32, 2> neighbors) {
    const i64 count = neighbors.size();
    auto result = Array<i32>::filled({count}, -1);
    const View<i32> part = result;
    std::vector<i64> stack;
    i32 parts = 0;
    for (i64 seed = 0; seed < count; ++seed) {
        if (part[seed] >= 0) continue;
        part[seed] = parts;
        stack.push_back(seed);
        while (!stack.empty()) {
            const i64 triangle = stack.back();
            stack.pop_back();
            for (i64 k = 0; k < 3; ++k) {
                const i64 other = neighbors(triangle, k);
                if (other >= 0 && part[other] < 0) {
                    part[other] = parts;
                    stack.push_back(other);
                }
            }
        }
        ++parts;
    }
    return result;
}

}  // namespace fleet2d
