// Many points seen from one place: which are in sight, and which are in range and angle.
//
// For methods of sight that are not part of the core: the queries of a span of steps, without
// consecutive duplicates.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "lens.hpp"
#include "poses.hpp"

namespace fleet2d {

// Which of the points, (n, 2), have a line of sight from (x, y), (n,).
Array<bool> points_in_sight(const Mesh& mesh, i64 x, i64 y, View<const i64, 2> points);

// A place and a direction, and how many points are in view from there.
struct BestView {
    i64 place = 0, direction = 0, count = 0;
};

// The place, of (m, 2), and the direction from which most of the points, (n, 2), are in view: in sight, no farther
// than the range [lattice units, squared], and within the angle of a camera, which is given by the cosine of its
// half. `halves`, (d, 2), are unit vectors of the first half of the directions; the others, from number d on, are
// opposite to these. Ties: the first place, then the first direction.
BestView best_view(const Mesh& mesh, View<const i64, 2> places, View<const i64, 2> points, f64 range_squared,
                   View<const f64, 2> halves, f64 cosine);

// Which of the points, (n, 2), are in range and within the angle of a camera, regardless of walls, (n,).
Array<bool> points_in_reach(Pose eye, i64 near_squared, i64 far_squared, i64 half_angle, View<const i64, 2> points);

// Which of the points, (n, 2), are nearer than `reach` [lattice units] to a line through points, (m, 2), (n,). Rounded
// as GEOS does.
Array<bool> points_near(View<const i64, 2> points, View<const i64, 2> line, f64 reach);

// The question whether a body is in view of a camera: both, the camera's pose, and the body's centre.
struct ViewQuery {
    i64 camera, body;
    i64 eye_x, eye_y, eye_heading;  // lattice units, 1/4096 turn
    i64 body_x, body_y;

    bool operator==(const ViewQuery&) const = default;
};

// The columns of a row of queries, by name.
inline constexpr std::array VIEW_QUERY_COLUMNS = std::to_array<std::pair<const char*, i64 ViewQuery::*>>({
    {"CAMERA", &ViewQuery::camera},
    {"BODY", &ViewQuery::body},
    {"EYE_X", &ViewQuery::eye_x},
    {"EYE_Y", &ViewQuery::eye_y},
    {"EYE_HEADING", &ViewQuery::eye_heading},
    {"BODY_X", &ViewQuery::body_x},
    {"BODY_Y", &ViewQuery::body_y},
});

// The positions of the bodies that may be in view, all arrays (bodies, n).
struct Places {
    View<const i64, 2> x;    // lattice units
    View<const i64, 2> y;    // lattice units
    View<const u8, 2> away;  // not 0 while the body is away
};

struct ViewQueries {
    std::vector<ViewQuery> queries;  // by camera and body
    Array<i32, 3> number;            // (cameras, bodies, n): the query of each step, from 1 on; 0 for none
};

// The queries of steps at which a body may be in view of a camera: near enough, and at most `slack`
// [lattice units] beside the angle. `widest` is (cameras, bodies), the largest squared distance in view;
// `robot` has the n poses of the cameras' owner from step `first` on. Equal consecutive queries are listed once.
ViewQueries list_view_queries(const Lenses& lenses, View<const i64, 2> widest, i64 slack, const Poses& robot,
                              const Places& bodies, i64 first, i64 step_us);

}  // namespace fleet2d
