#include "taut.hpp"

#include <algorithm>
#include <limits>

#include "grid.hpp"
#include "line_of_sight.hpp"

namespace fleet2d {
namespace {

constexpr f64 ENDLESS = std::numeric_limits<f64>::infinity();
constexpr f64 SLACK = 1.0 + 1e-9;  // what rounding may make a leg dearer than the two that it replaces

// How far along a leg it leaves a cell of its row, or column: the share of the leg from `start` on,
// which is `run` long in this direction; above 1 if it stays.
f64 share_to_border(i64 cell, i64 start, i64 run) {
    if (run == 0) return 2.0;
    const i64 border = (run > 0 ? cell + 1 : cell) * SUB;
    return static_cast<f64>(border - start) / static_cast<f64>(run);
}

Point point_of(View<const i64, 2> way, i64 i) { return {way(i, 0), way(i, 1)}; }

// The last point of a way to which a straight leg from point `first` is clear, and no dearer than the
// way; behind the last point of the way, its end.
i64 end_of_leg(const Mesh& mesh, View<const i32, 2> cost, View<const i64, 2> way, i64 first) {
    i64 last = first + 1;
    if (last == way.size()) return last;
    const Point begin = point_of(way, first);
    const i64 triangle = locate(mesh, begin.x, begin.y);
    f64 along = leg_cost(cost, begin, point_of(way, last));
    for (; last + 1 < way.size(); ++last) {
        const Point next = point_of(way, last + 1);
        along += leg_cost(cost, point_of(way, last), next);
        const f64 joint = leg_cost(cost, begin, next);
        if (joint == ENDLESS || joint > along * SLACK) break;
        if (!line_of_sight(mesh, begin.x, begin.y, triangle, next.x, next.y)) break;
    }
    return last;
}

}  // namespace

f64 leg_cost(View<const i32, 2> cost, Point a, Point b) {
    const i64 dx = b.x - a.x, dy = b.y - a.y;
    const f64 length = distance(a.x, a.y, b.x, b.y);
    GridCell cell{floor_div(a.y, SUB), floor_div(a.x, SUB)};
    f64 total = 0.0, done = 0.0;
    while (is_inside(cost.shape, cell) && at(cost, cell) >= 0) {
        const f64 next_x = share_to_border(cell.column, a.x, dx), next_y = share_to_border(cell.row, a.y, dy);
        const f64 leaves = std::min({next_x, next_y, 1.0});
        total += (leaves - done) * length * static_cast<f64>(i64{100} + at(cost, cell));
        if (leaves >= 1.0) return total;
        done = leaves;
        if (next_x == leaves) cell.column += dx > 0 ? 1 : -1;
        if (next_y == leaves) cell.row += dy > 0 ? 1 : -1;
    }
    return ENDLESS;
}

Array<i64, 2> pull_taut(const Mesh& mesh, View<const i32, 2> cost, View<const i64, 2> way) {
    auto pulled = Array<i64, 2>::empty({way.size(), 2});
    i64 count = 0;
    for (i64 corner = 0; corner < way.size(); corner = end_of_leg(mesh, cost, way, corner)) {
        pulled(count, 0) = way(corner, 0);
        pulled(count, 1) = way(corner, 1);
        ++count;
    }
    pulled.truncate(count);
    return pulled;
}

}  // namespace fleet2d
