#include "points.hpp"

namespace fleet2d {

Array<bool> points_in_sight(const Mesh& mesh, i64 x, i64 y, View<const i64, 2> points) {
    auto visible = Array<bool>::empty({points.size()});
    const i64 triangle = locate(mesh, x, y);
    for (i64 i = 0; i < points.size(); ++i) {
        visible[i] = line_of_sight(mesh, x, y, triangle, points(i, 0), points(i, 1));
    }
    return visible;
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

}  // namespace fleet2d
