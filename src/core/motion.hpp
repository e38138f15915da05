// Poses over time: tracks between breakpoints, and the random walk of a meandering body.
//
// A track is a row of breakpoints. Between two of them the pose moves in a straight line and turns
// the shorter way, both at a constant rate; before the first and after the last one it stays.
#pragma once

#include "headings.hpp"
#include "mesh.hpp"
#include "poses.hpp"

namespace fleet2d {

// A track, all arrays (n,).
struct Breakpoints {
    View<const i64> time;     // us, ascending; where two are equal, the later one counts
    View<const i64> x;        // lattice units
    View<const i64> y;        // lattice units
    View<const i64> heading;  // 1/4096 turn
    View<const u8> away;      // 1 = not at home

    i64 size() const { return time.size(); }
    Breakpoints slice(i64 first, i64 last) const {
        return {time.slice(first, last), x.slice(first, last), y.slice(first, last), heading.slice(first, last),
                away.slice(first, last)};
    }
};

// Poses to be written to.
struct PosesToFill {
    View<i64> x;
    View<i64> y;
    View<i64> heading;
    View<u8> away;

    operator Poses() const { return {x, y, heading, away}; }
    i64 size() const { return x.size(); }
};

// The last index i with time[i] <= moment; 0 if there is none.
i64 last_breakpoint(View<const i64> time, i64 moment);

// Bounds of the times [us] and of all other values of a track, so that products in the interpolation
// fit in 64 bits: see `is_traceable`.
inline constexpr i64 LATEST = i64{1} << 61;
inline constexpr i64 FARTHEST = i64{1} << 40;

// Whether all arrays have one length, the times ascend, and nothing is too large to be interpolated.
bool is_traceable(const Breakpoints& track);

// Write the poses at times begin, begin + step, ... [us] to `out`. The track is traceable.
void trace_track(const Breakpoints& track, i64 begin, i64 step, const PosesToFill& out);

// now + the least whole number of microseconds that is not below `us`; LATEST at most.
i64 later(i64 now, f64 us);

// Turn on the spot towards each leg of a polyline, then walk it: call `add(time, x, y, heading)` at the end of each
// turn and of each leg. The arguments are those of `time_route`.
template <class Add>
void walk_route(View<const i64, 2> route, i64 now, i64 heading, f64 speed, f64 turn_rate, Add add) {
    for (i64 i = 1; i < route.size(); ++i) {
        const i64 dx = route(i, 0) - route(i - 1, 0), dy = route(i, 1) - route(i - 1, 1);
        if (dx == 0 && dy == 0) continue;
        const i64 towards = heading_of(dx, dy);
        const i64 turn = std::abs(turn_between(heading, towards));
        if (turn > 0) {
            now = later(now, static_cast<f64>(turn) * 1e6 / turn_rate);
            heading = towards;
            add(now, route(i - 1, 0), route(i - 1, 1), heading);
        }
        now = later(now, distance(0, 0, dx, dy) * 1e6 / speed);
        add(now, route(i, 0), route(i, 1), heading);
    }
}

// Turn a polyline into breakpoints: turn on the spot towards each leg, then walk it.
//
// `route` is (n, 2) lattice points, `begin` [us] and `heading` the state at route[0], `speed` in
// lattice units and `turn_rate` in headings per second. Returns rows (time, x, y, heading), the first
// of them the start; no time is later than LATEST.
Array<i64, 2> time_route(View<const i64, 2> route, i64 begin, i64 heading, f64 speed, f64 turn_rate);

// How a meandering body moves in one step.
struct WalkRule {
    u64 key;         // of its random stream
    i64 stride;      // 1/256 lattice units forward
    i64 sway;        // standard deviation of the turn, in 2**-16 headings per unit of random_bell
    i64 turn_limit;  // headings, half a turn at most
    i64 stays;       // 1: where a wall is in the way it only sways, as the published Fleet2D does
};

// Walk at random from `start` and `heading`, where the body is at step `first`; out[j] is the pose at
// step first + j.
//
// In each step the body turns by a bell-shaped random angle and goes one stride forward. If that would
// leave `space`, the places its centre may be, it stays and turns by any angle within its limit
// instead, all equally likely, so that it comes away from the wall.
void trace_meander(const Mesh& walls, const Mesh& space, const WalkRule& rule, i64 first, Point start, i64 heading,
                   const PosesToFill& out);

}  // namespace fleet2d
