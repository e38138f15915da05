#include "legs.hpp"

#include <nanobind/stl/optional.h>

#include "arrays.hpp"
#include "motion.hpp"
#include "routes.hpp"
#include "subjects.hpp"

namespace fleet2d {

namespace {

void add_checked(Legs& legs, View<const i64, 2> rows) {
    require(rows.shape[1] == 5, "rows must be (n, 5)");
    for (i64 i = 0; i < rows.size(); ++i) {
        legs.mark(checked(rows(i, 0), rows(i, 1), rows(i, 2), rows(i, 3), rows(i, 4)));
    }
}

void check_turn(i64 headings) {
    require(-(i64{1} << 40) < headings && headings < i64{1} << 40, "headings must be within 2**40 of 0");
}

}  // namespace

void bind_legs(nb::module_& m) {
    nb::class_<Legs>(m, "Legs", "The breakpoints of a plan, which is built leg by leg.")
        .def(nb::init<>())
        .def("__len__", &Legs::size)
        .def(
            "mark",
            [](Legs& self, i64 time, i64 x, i64 y, i64 heading, i64 away) {
                self.mark(checked(time, x, y, heading, away));
            },
            "time"_a, "x"_a, "y"_a, "heading"_a, "away"_a,
            "Add a breakpoint: time [us], x, y [lattice], heading [1/4096 turn], away.")
        .def("add", &add_checked, "rows"_a, "Add breakpoints, int64 (n, 5).")
        .def(
            "turn",
            [](Legs& self, i64 time, i64 x, i64 y, i64 heading, i64 away, i64 headings, f64 turn_rate) {
                check_turn(headings);
                require(turn_rate > 0, "turn_rate must be above 0");
                return plain(self.turn(checked(time, x, y, heading, away), headings, turn_rate));
            },
            "time"_a, "x"_a, "y"_a, "heading"_a, "away"_a, "headings"_a, "turn_rate"_a,
            R"(Turn on the spot by a number of headings, counter-clockwise if positive.

Returns:
    time, x, y, heading and away at the end.)")
        .def(
            "walk",
            [](Legs& self, i64 time, i64 heading, View<const i64, 2> route, f64 speed, f64 turn_rate) {
                require(route.size() > 0 && route.shape[1] == 2, "route must be (n, 2), one point or more");
                require(all_in_range(route, -FARTHEST_POSE, FARTHEST_POSE), "route must be within 2**29 of 0");
                check_rates(speed, turn_rate);
                return plain(self.walk(checked(time, 0, 0, heading, 0), route, speed, turn_rate));
            },
            "time"_a, "heading"_a, "route"_a, "speed"_a, "turn_rate"_a,
            R"(Turn towards each leg of a route (n, 2) and walk it, at home, as `time_route` does.

Returns:
    time, x, y, heading and away at the end.)")
        .def(
            "go",
            [](Legs& self, i64 time, i64 x, i64 y, i64 heading, Routes& routes, i64 to_x, i64 to_y, f64 speed,
               f64 turn_rate, std::optional<std::pair<i64, i64>> off) -> std::optional<MomentRow> {
                const std::pair from = off.value_or(std::pair(x, y));
                checked(time, from.first, from.second, heading, 0);
                const Moment now = checked(time, x, y, heading, 0);
                check_rates(speed, turn_rate);
                const auto route = [&] {
                    const nb::gil_scoped_release unlocked;
                    return routes.find({from.first, from.second}, {to_x, to_y});
                }();
                if (route.empty()) return {};
                const Moment off_it = self.step_to(now, {from.first, from.second}, speed, turn_rate);
                return plain(self.walk(off_it, rows_of(route), speed, turn_rate));
            },
            "time"_a, "x"_a, "y"_a, "heading"_a, "routes"_a, "to_x"_a, "to_y"_a, "speed"_a, "turn_rate"_a,
            "off"_a = nb::none(),
            R"(Walk the shortest way to a point, at home, from the point `off` to which it first steps, if that is given.

Returns:
    time, x, y, heading and away at the end; None if no way leads there, or an end isn't strictly inside.)")
        .def(
            "visit",
            [](Legs& self, i64 time, i64 x, i64 y, i64 heading, Routes& routes, View<const i64, 2> stops, f64 speed,
               f64 turn_rate, i64 headings, i64 stay) -> std::optional<MomentRow> {
                Moment now = checked(time, x, y, heading, 0);
                check_rates(speed, turn_rate);
                check_turn(headings);
                require(stops.shape[1] == 2, "stops must be (n, 2)");
                require(0 <= stay && stay <= LATEST, "stay must be 0 or more, and at most 2**61 us");
                std::vector<std::vector<Point>> ways;
                Point from{x, y};
                for (i64 i = 0; i < stops.size(); ++i) {
                    const Point stop{stops(i, 0), stops(i, 1)};
                    const nb::gil_scoped_release unlocked;
                    ways.push_back(routes.find(from, stop));
                    if (ways.back().empty()) return {};
                    from = stop;
                }
                for (const std::vector<Point>& way : ways) {
                    now = self.turn(self.walk(now, rows_of(way), speed, turn_rate), headings, turn_rate);
                    now = checked(now.time + stay, now.x, now.y, now.heading, 0);
                    self.mark(now);
                }
                return plain(now);
            },
            "time"_a, "x"_a, "y"_a, "heading"_a, "routes"_a, "stops"_a, "speed"_a, "turn_rate"_a, "headings"_a,
            "stay"_a,
            R"(Walk the shortest ways from stop to stop, int64 (n, 2), at home; at each turn and stay.

Args:
    headings: By how many headings it turns at each stop.
    stay: How long it stays then [us].

Returns:
    time, x, y, heading and away at the end; None, without a breakpoint, if no way leads to one of them.)")
        .def(
            "settle",
            [](Legs& self, i64 time, i64 x, i64 y, i64 heading, i64 at_x, i64 at_y, i64 at_heading, f64 speed,
               f64 turn_rate) {
                checked(time, at_x, at_y, at_heading, 0);
                check_rates(speed, turn_rate);
                return plain(self.settle(checked(time, x, y, heading, 0), {at_x, at_y}, at_heading, speed, turn_rate));
            },
            "time"_a, "x"_a, "y"_a, "heading"_a, "at_x"_a, "at_y"_a, "at_heading"_a, "speed"_a, "turn_rate"_a,
            R"(Walk straight to a point, and turn to a heading there, at home.

Returns:
    time, x, y, heading and away at the end.)")
        .def("rows", &Legs::rows, "Return all breakpoints: int64 (n, 5).")
        .def(
            "track",
            [](const Legs& self) {
                return std::make_tuple(self.column<i64>(0), self.column<i64>(1), self.column<i64>(2),
                                       self.column<i64>(3), self.column<u8>(4));
            },
            "Return all breakpoints by column: time, x, y, heading, int64 (n,), and away, uint8 (n,).")
        .def("__getstate__", &Legs::rows)
        .def("__setstate__", [](Legs& self, View<const i64, 2> rows) {
            new (&self) Legs();
            add_checked(self, rows);
        });
}

}  // namespace fleet2d
