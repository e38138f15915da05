#include "../points.hpp"

#include "lens.hpp"
#include "line_of_sight.hpp"
#include "mesh.hpp"
#include "poses.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

enum class ViewQueryColumn : i64 {};

Array<i64, 2> rows_of(const std::vector<ViewQuery>& queries) {
    auto rows = Array<i64, 2>::empty({static_cast<i64>(queries.size()), VIEW_QUERY_COLUMNS.size()});
    for (i64 row = 0; row < rows.size(); ++row) {
        i64 column = 0;
        for (const auto& [_, member] : VIEW_QUERY_COLUMNS) {
            rows(row, column++) = queries[static_cast<std::size_t>(row)].*member;
        }
    }
    return rows;
}

}  // namespace

void bind_points(nb::module_& m) {
    auto columns = nb::enum_<ViewQueryColumn>(m, "ViewQueryColumn", nb::is_arithmetic(),
                                              "The columns of a query of `view_queries`: the pose of the camera, the "
                                              "centre of the body.");
    for (std::size_t i = 0; i < VIEW_QUERY_COLUMNS.size(); ++i) {
        columns.value(VIEW_QUERY_COLUMNS[i].first, static_cast<ViewQueryColumn>(i));
    }
    m.def(
        "points_in_sight",
        [](const Mesh& mesh, i64 x, i64 y, View<const i64, 2> points) {
            check_point(x, y);
            check_points(points);
            return points_in_sight(mesh, x, y, points);
        },
        "mesh"_a, "x"_a, "y"_a, "points"_a, Unlocked(),
        "Return which of the points, int64 (n, 2), a line of sight leads to from (x, y): bool (n,).");
    m.def(
        "best_view",
        [](const Mesh& mesh, View<const i64, 2> places, View<const i64, 2> points, f64 range_squared,
           View<const f64, 2> halves, f64 cosine) -> std::optional<std::pair<i64, i64>> {
            check_points(places);
            check_points(points);
            require(halves.shape[1] == 2, "halves must be (d, 2)");
            const BestView best = best_view(mesh, places, points, range_squared, halves, cosine);
            if (best.count == 0) return std::nullopt;
            return std::pair(best.place, best.direction);
        },
        "mesh"_a, "places"_a, "points"_a, "range_squared"_a, "halves"_a, "cosine"_a, Unlocked(),
        R"(Return the place and the direction from which a camera has most points in view.

Args:
    mesh: Free space.
    places: int64 (m, 2), lattice points.
    points: int64 (n, 2), lattice points.
    range_squared: The range of the camera, squared [lattice units].
    halves: float64 (d, 2), unit vectors of the first half of the directions; the others, from
        number d on, are opposite to these.
    cosine: The cosine of half the angle of the camera.

Returns:
    The number of the place and of the direction, the first ones if tied; None where no point is in
    view from any place.)");
    m.def(
        "points_near",
        [](View<const i64, 2> points, View<const i64, 2> line, f64 reach) {
            check_points(points);
            check_points(line);
            return points_near(points, line, reach);
        },
        "points"_a, "line"_a, "reach"_a, Unlocked(),
        R"(Return which points are nearer to a line than a distance, which is rounded as in GEOS.

Args:
    points: int64 (n, 2), lattice points.
    line: int64 (m, 2), lattice points along the line.
    reach: The distance [lattice units].

Returns:
    bool (n,); a line of fewer than two points is near nothing.)");
    m.def(
        "points_in_reach",
        [](i64 x, i64 y, i64 heading, std::tuple<i64, i64, i64> reach, View<const i64, 2> points) {
            check_point(x, y);
            check_points(points);
            const auto [near_squared, far_squared, half_angle] = reach;
            return points_in_reach({x, y, heading}, near_squared, far_squared, half_angle, points);
        },
        "x"_a, "y"_a, "heading"_a, "reach"_a, "points"_a, Unlocked(),
        R"(Return which points are in range and within the angle, regardless of walls.

Args:
    x: Position of the camera [lattice units].
    y: Position of the camera [lattice units].
    heading: Its heading [1/4096 turn].
    reach: Its range and angle, a `Reach`.
    points: int64 (n, 2).

Returns:
    bool (n,).)");
    m.def(
        "view_queries",
        [](const Lenses& lenses, View<const i64, 2> widest, i64 slack, const Poses& robot, View<const i64, 2> x,
           View<const i64, 2> y, View<const u8, 2> away, i64 first, i64 step_us) {
            check_lenses(lenses);
            check_poses(robot);
            const i64 bodies = widest.shape[1];
            require(widest.shape[0] == lenses.period.size() && bodies == lenses.reach.shape[1],
                    "widest must be (cameras, bodies), as the lenses are");
            for (const auto& shape : {x.shape, y.shape, away.shape}) {
                require(shape[0] == bodies && shape[1] == robot.x.size(), "x, y and away must be (bodies, n)");
            }
            ViewQueries view_queries = list_view_queries(lenses, widest, slack, robot, {x, y, away}, first, step_us);
            return std::tuple(rows_of(view_queries.queries), std::move(view_queries.number));
        },
        "lenses"_a, "widest"_a, "slack"_a, "robot"_a, "x"_a, "y"_a, "away"_a, "first"_a, "step_us"_a, Unlocked(),
        R"(List the steps at which a body may be in view of a camera: near enough, and not far beside the angle.

Args:
    lenses: Lenses.
    widest: int64 (cameras, bodies), the largest squared distance in view.
    slack: Largest distance beside the angle [lattice units].
    robot: The n poses of the body with the cameras.
    x: int64 (bodies, n), positions of the others.
    y: int64 (bodies, n).
    away: uint8 (bodies, n), not 0 while the body is away.
    first: The step of the first pose.
    step_us: Length of a step.

Returns:
    int64 (m, 7) by camera and body, and int32 (cameras, bodies, n): the number of the query that
    each step, from 1 on; 0 for none. Equal consecutive queries are listed once.)");
}

}  // namespace fleet2d
