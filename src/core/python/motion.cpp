#include "motion.hpp"

#include <algorithm>

#include "mesh.hpp"
#include "subjects.hpp"

namespace fleet2d {

namespace {

constexpr i64 MOST = i64{1} << 29;  // coordinates and headings of a route or a walk: their squares fit in 64 bits

// The breakpoints that are needed from one moment to another.
Breakpoints part_between(const Breakpoints& track, i64 first_moment, i64 last_moment) {
    const i64 first = last_breakpoint(track.time, first_moment);
    const i64 end = std::min(track.size(), last_breakpoint(track.time, last_moment) + 2);
    require(first < end, "the times of a track must ascend");
    return track.slice(first, end);
}

void trace_checked_track(const Breakpoints& track, i64 begin, i64 step, const PosesToFill& out) {
    check_poses(out);
    const i64 points = track.size();
    require(points > 0 && track.x.size() == points && track.y.size() == points && track.heading.size() == points &&
                track.away.size() == points,
            "all arrays of a track must have one length, 1 or more");
    const i64 count = std::max(i64{1}, out.size());
    require(-LATEST <= begin && begin <= LATEST && 0 < step && step <= LATEST / count,
            "begin must be at most 2**61 us, step 1 or more, and all steps at most 2**61 us");
    // Its other breakpoints aren't looked at: a track may be a month long, and be traced an hour at a time.
    const Breakpoints part = part_between(track, begin, begin + (count - 1) * step);
    require(is_traceable(part),
            "a track's times must ascend, its coordinates be small and its legs short enough for 64 bits");
    trace_track(part, begin, step, out);
}

Array<i64, 2> time_checked_route(View<const i64, 2> route, i64 begin, i64 heading, f64 speed, f64 turn_rate) {
    require(route.size() > 0 && route.shape[1] == 2, "route must be (n, 2), one point or more");
    require(all_in_range(route, -MOST, MOST), "route must be within 2**29 of 0");
    require(-LATEST <= begin && begin <= LATEST, "begin must be at most 2**61 us");
    require(-MOST < heading && heading < MOST, "heading must be within 2**29 of 0");
    require(speed > 0 && turn_rate > 0, "speed and turn_rate must be above 0");
    return time_route(route, begin, heading, speed, turn_rate);
}

void trace_checked_meander(const Mesh& walls, const Mesh& space, const WalkRule& rule, i64 first,
                           std::tuple<i64, i64, i64> start, const PosesToFill& out) {
    const auto [x, y, heading] = start;
    check_poses(out);
    for (const i64 number : {x, y, heading}) {
        require(-MOST < number && number < MOST, "start must be within 2**29 of 0");
    }
    require(0 <= rule.stride && rule.stride < (i64{1} << 31), "stride must be in 0 to 2**31 - 1");
    require(0 <= rule.sway && rule.sway < (i64{1} << 52), "sway must be in 0 to 2**52 - 1");
    require(0 <= rule.turn_limit && rule.turn_limit < (i64{1} << 30), "turn_limit must be in 0 to 2**30 - 1");
    trace_meander(walls, space, rule, first, {x, y}, heading, out);
}

}  // namespace

void bind_motion(nb::module_& m) {
    m.def("trace_track", &trace_checked_track, "track"_a, "begin"_a, "step"_a, "out"_a, Unlocked(),
          R"(Write the poses of a track at times begin, begin + step, ... to `out`.

Args:
    track: Breakpoints, in order of time; of two at one time the later one counts.
    begin: Time of the first pose [us].
    step: Time between two poses [us], 1 or more.
    out: Poses, to be written to.

Raises:
    ValueError: The times don't ascend, or a leg is so long that its interpolation leaves 64 bits.)");
    m.def("time_route", &time_checked_route, "route"_a, "begin"_a, "heading"_a, "speed"_a, "turn_rate"_a, Unlocked(),
          R"(Turn a polyline into breakpoints: turn on the spot towards each leg, then walk it.

Args:
    route: int64 (n, 2), lattice points.
    begin: Time at route[0] [us].
    heading: Heading at route[0] [1/4096 turn].
    speed: Lattice units per second.
    turn_rate: Headings per second.

Returns:
    int64 (m, 4), rows (time, x, y, heading); the first is the start. A point twice in a row has one.)");
    m.def("trace_meander", &trace_checked_meander, "walls"_a, "space"_a, "rule"_a, "first"_a, "start"_a, "out"_a,
          Unlocked(),
          R"(Walk at random from `start`, for as many steps as `out` has poses.

In each step the body turns by a bell-shaped random angle and goes one stride forward. If that
would leave `space`, the places its centre may be, it stays and turns by any angle within its
limit instead, all equally likely, so that it comes away from the wall.

Args:
    walls: What the body can't walk through, as Mesh.
    space: Where its centre may be, as Mesh.
    rule: WalkRule.
    first: The step of the first pose.
    start: x, y [lattice units] and heading [1/4096 turn] at that step.
    out: Poses, to be written to.)");
}

}  // namespace fleet2d
