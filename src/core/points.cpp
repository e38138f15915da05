#include "points.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace fleet2d {
namespace {

// The ways from a place to the points in range [lattice units], and how much of each has to be ahead.
struct Gaps {
    std::vector<f64> x, y, least;

    void clear() {
        x.clear();
        y.clear();
        least.clear();
    }

    void add(i64 dx, i64 dy, f64 cosine) {
        x.push_back(static_cast<f64>(dx));
        y.push_back(static_cast<f64>(dy));
        least.push_back(std::sqrt(x.back() * x.back() + y.back() * y.back()) * cosine);
    }

    // The direction that has most of them within the angle; `place` is passed on.
    BestView best(i64 place, View<const f64, 2> halves) const {
        BestView best{place};
        const std::size_t size = x.size();
        for (const bool is_opposite : {false, true}) {
            for (i64 k = 0; k < halves.size(); ++k) {
                const f64 sign = is_opposite ? -1.0 : 1.0, along = sign * halves(k, 0), up = sign * halves(k, 1);
                i64 count = 0;
                for (std::size_t i = 0; i < size; ++i) count += x[i] * along + y[i] * up >= least[i];
                if (count > best.count) best = {place, k + (is_opposite ? halves.size() : 0), count};
            }
        }
        return best;
    }
};

struct Spot {
    f64 x, y;

    f64 distance_to(const Spot& other) const {
        const f64 dx = x - other.x, dy = y - other.y;
        return std::sqrt(dx * dx + dy * dy);
    }
};

Spot spot_of(View<const i64> point) { return {static_cast<f64>(point[0]), static_cast<f64>(point[1])}; }

// The distance of a point from the way from a to b.
f64 distance_to_piece(const Spot& point, const Spot& a, const Spot& b) {
    const f64 dx = b.x - a.x, dy = b.y - a.y, squared = dx * dx + dy * dy;
    if (squared == 0) return point.distance_to(a);
    const f64 along = ((point.x - a.x) * dx + (point.y - a.y) * dy) / squared;
    if (along <= 0) return point.distance_to(a);
    if (along >= 1) return point.distance_to(b);
    const f64 beside = ((a.y - point.y) * dx - (a.x - point.x) * dy) / squared;
    return std::abs(beside) * std::sqrt(squared);
}

}  // namespace

Array<bool> points_in_sight(const Mesh& mesh, i64 x, i64 y, View<const i64, 2> points) {
    auto visible = Array<bool>::empty({points.size()});
    const i64 triangle = locate(mesh, x, y);
    for (i64 i = 0; i < points.size(); ++i) {
        visible[i] = line_of_sight(mesh, x, y, triangle, points(i, 0), points(i, 1));
    }
    return visible;
}

BestView best_view(const Mesh& mesh, View<const i64, 2> places, View<const i64, 2> points, f64 range_squared,
                   View<const f64, 2> halves, f64 cosine) {
    // What would be in view without walls is the most that can be, so few places need lines of sight.
    std::vector<BestView> bounds;
    std::vector<std::size_t> near;
    Gaps gaps;
    const auto collect = [&](i64 place, auto is_in_sight) {
        gaps.clear();
        for (i64 i = 0; i < points.size(); ++i) {
            const i64 dx = points(i, 0) - places(place, 0), dy = points(i, 1) - places(place, 1);
            if (static_cast<f64>(dx * dx + dy * dy) <= range_squared && is_in_sight(i)) gaps.add(dx, dy, cosine);
        }
    };
    for (i64 place = 0; place < places.size(); ++place) {
        collect(place, [](i64) { return true; });
        bounds.push_back(gaps.best(place, halves));
        near.push_back(gaps.x.size());
    }
    std::vector<BestView> ordered = bounds;
    std::ranges::stable_sort(ordered, std::greater(), &BestView::count);
    BestView best;
    for (const BestView& bound : ordered) {
        if (bound.count < best.count || bound.count == 0) break;
        if (bound.count == best.count && bound.place > best.place) continue;
        const i64 x = places(bound.place, 0), y = places(bound.place, 1), triangle = locate(mesh, x, y);
        collect(bound.place, [&](i64 i) { return line_of_sight(mesh, x, y, triangle, points(i, 0), points(i, 1)); });
        const bool is_all = gaps.x.size() == near[static_cast<std::size_t>(bound.place)];
        const BestView view = is_all ? bound : gaps.best(bound.place, halves);
        if (view.count > best.count || (view.count == best.count && view.place < best.place)) best = view;
    }
    return best;
}

Array<bool> points_in_reach(Pose eye, i64 near_squared, i64 far_squared, i64 half_angle, View<const i64, 2> points) {
    auto reached = Array<bool>::empty({points.size()});
    for (i64 i = 0; i < points.size(); ++i) {
        const i64 dx = points(i, 0) - eye.x, dy = points(i, 1) - eye.y;
        const i64 squared = dx * dx + dy * dy;
        reached[i] = near_squared <= squared && squared <= far_squared && in_wedge(eye.heading, half_angle, dx, dy);
    }
    return reached;
}

ViewQueries list_view_queries(const Lenses& lenses, View<const i64, 2> widest, i64 slack, const Poses& robot,
                              const Places& bodies, i64 first, i64 step_us) {
    const i64 cameras = widest.shape[0], body_count = widest.shape[1], steps = robot.x.size();
    ViewQueries view_queries;
    view_queries.number = Array<i32, 3>::zeros({cameras, body_count, steps});
    const View<i32, 3> number = view_queries.number;
    std::vector<ViewQuery>& queries = view_queries.queries;
    for (i64 camera = 0; camera < cameras; ++camera) {
        const i64 period = lenses.period[camera], half_angle = lenses.half_angle[camera];
        for (i64 j = floor_mod(-first, period); j < steps; j += period) {
            if (robot.away[j] != 0) continue;
            const Pose body = {robot.x[j], robot.y[j], robot.heading[j]};
            const Pose eye = camera_pose(lenses, camera, body, (first + j) * step_us);
            for (i64 other = 0; other < body_count; ++other) {
                const i64 x = bodies.x(other, j), y = bodies.y(other, j);
                const i64 dx = x - eye.x, dy = y - eye.y;
                if (bodies.away(other, j) != 0 || dx * dx + dy * dy > widest(camera, other)) continue;
                if (!near_wedge(eye.heading, half_angle, dx, dy, lenses.reach(camera, other) + slack)) continue;
                const ViewQuery query = {camera, other, eye.x, eye.y, eye.heading, x, y};
                const i32 before = j >= period ? number(camera, other, j - period) : 0;
                if (before > 0 && query == queries[static_cast<std::size_t>(before - 1)]) {
                    number(camera, other, j) = before;
                } else {
                    queries.push_back(query);
                    number(camera, other, j) = static_cast<i32>(queries.size());
                }
            }
        }
    }
    return view_queries;
}

Array<bool> points_near(View<const i64, 2> points, View<const i64, 2> line, f64 reach) {
    auto near = Array<bool>::zeros({points.size()});
    for (i64 i = 0; i + 1 < line.size(); ++i) {
        const Spot a = spot_of(line[i]), b = spot_of(line[i + 1]);
        const f64 left = std::min(a.x, b.x) - reach, right = std::max(a.x, b.x) + reach;
        const f64 bottom = std::min(a.y, b.y) - reach, top = std::max(a.y, b.y) + reach;
        for (i64 k = 0; k < points.size(); ++k) {
            const Spot point = spot_of(points[k]);
            if (point.x < left || point.x > right || point.y < bottom || point.y > top) continue;
            near[k] = near[k] || distance_to_piece(point, a, b) < reach;
        }
    }
    return near;
}

}  // namespace fleet2d
