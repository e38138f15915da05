#include "giving_way.hpp"

#include "legs.hpp"
#include "motion.hpp"
#include "subjects.hpp"
#include "timelines.hpp"

namespace fleet2d {
namespace {

constexpr i64 LONGEST_BEAT = i64{1} << 40;  // us: 12 days

// Add what a function of Python returns for a way that no shortest route leads.
std::optional<Moment> add_way(const nb::callable& walk, Legs& legs, const Moment& now, Point to,
                              const std::vector<Disc>& discs) {
    const nb::object rows = walk(now.time, now.x, now.y, now.heading, to.x, to.y, rows_of(discs));
    if (rows.is_none()) return {};
    View<const i64, 2> breakpoints;
    nb::object copy;
    require(border::view_of(rows, breakpoints, copy) && breakpoints.shape[1] == 5, "walk must return rows (n, 5)");
    Moment end = now;
    for (i64 i = 0; i < breakpoints.size(); ++i) {
        require(breakpoints(i, 0) >= end.time, "walk must return rows in order of time");
        end = checked(breakpoints(i, 0), breakpoints(i, 1), breakpoints(i, 2), breakpoints(i, 3), breakpoints(i, 4));
        legs.mark(end);
    }
    return end;
}

}  // namespace

Array<i64, 2> rows_of(const std::vector<Disc>& discs) {
    auto rows = Array<i64, 2>::empty({static_cast<i64>(discs.size()), 3});
    const View<i64, 2> values = rows;
    for (i64 i = 0; i < values.size(); ++i) {
        const Disc& disc = discs[static_cast<std::size_t>(i)];
        values(i, 0) = disc.at.x, values(i, 1) = disc.at.y, values(i, 2) = disc.reach;
    }
    return rows;
}

Yielder yielder_of(const YielderFields& fields) {
    const auto& [row, space, routes, speed, turn_rate, beat, walk] = fields;
    Routes* shortest = nullptr;
    require(routes.is_none() || nb::try_cast(routes, shortest), "routes must be Routes or None");
    check_rates(speed, turn_rate);
    require(0 < beat && beat < LONGEST_BEAT, "beat_us must be above 0, and below 2**40");
    const auto can_stand = [&fields](Point at) { return strictly_inside(std::get<1>(fields), at.x, at.y); };
    const auto go = [=, &fields](Legs& legs, const Moment& now, Point to,
                                 const std::vector<Disc>& discs) -> std::optional<Moment> {
        const auto& [row, space, routes, speed, turn_rate, beat, walk] = fields;
        const Point from{now.x, now.y};
        if (shortest && can_stand(from)) {
            const auto route = discs.empty() ? shortest->find(from, to) : shortest->around(from, to, discs);
            if (!route.empty()) return legs.walk(now, rows_of(route), speed, turn_rate);
            if (!discs.empty()) return {};
        }
        return add_way(walk, legs, now, to, discs);
    };
    return {row, turn_rate, beat, go, can_stand};
}

BodyInWay body_in_way_of(const BodyInWayFields& fields, const Mesh& space) {
    const auto& [other, near, distance, rooms, parts, part] = fields;
    for (const i64 units : {near, distance}) require(0 <= units && units < FARTHEST_POSE, "distances must be small");
    const auto has_part = [rooms = rooms, part = part](Point at, const auto& part_at) {
        return is_inside(rooms.shape, {floor_div(at.y, SUB), floor_div(at.x, SUB)}) && part_at(at) == part;
    };
    if (nb::isinstance<nb::callable>(parts)) {
        const auto ask = [&parts = parts](Point at) { return nb::cast<i64>(parts(at.x, at.y)); };
        return {other, near, distance, rooms, [=](Point at) { return has_part(at, ask); }};
    }
    View<const i32> part_of_triangle;
    nb::object copy;
    require(border::view_of(parts, part_of_triangle, copy) && part_of_triangle.size() == space.triangle_count(),
            "parts must be a function, or int32 (triangles,)");
    const auto look_up = [copy, part_of_triangle, &space](Point at) -> i64 {
        return strictly_inside(space, at.x, at.y) ? part_of_triangle[locate(space, at.x, at.y)] : OUTSIDE;
    };
    return {other, near, distance, rooms, [=](Point at) { return has_part(at, look_up); }};
}

AsideSearch aside_search_of(const AsideSearchFields& fields) {
    const auto& [parts, part, from, near, far, spacing, most, reach] = fields;
    for (const i64 cells : {near, far}) require(0 <= cells && cells < FARTHEST_POSE, "near and far must be small");
    require(0 < spacing && spacing < FARTHEST_POSE, "spacing must be small");
    require(all_in_range(reach, 0, FARTHEST_POSE), "reach must be small");
    const auto begin = [shape = parts.shape, &from = from] {
        const auto [x, y] = nb::cast<std::pair<i64, i64>>(from());
        require(is_inside(shape, {floor_div(y, SUB), floor_div(x, SUB)}), "from must return a point in a cell");
        return Point{x, y};
    };
    return {{parts, part}, begin, near, far, spacing, most, reach};
}

std::vector<Point> points_of(View<const i64, 2> rows) {
    std::vector<Point> points;
    for (i64 i = 0; i < rows.size(); ++i) points.push_back({rows(i, 0), rows(i, 1)});
    return points;
}

void bind_giving_way(nb::module_& m) {
    m.def(
        "next_stop",
        [](const Mesh& space, const Breakpoints& track, i64 moment) {
            const auto can_stand = [&](Point at) { return strictly_inside(space, at.x, at.y); };
            return next_stop(piece_of(track), moment, can_stand);
        },
        "space"_a, "track"_a, "moment"_a,
        R"(Return the breakpoint at which a body next stands still after a moment [us]; -1 for none.

A turn at a corner, on the border of its space, is no stop.)");
}

}  // namespace fleet2d
