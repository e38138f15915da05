#include "motion.hpp"

#include <algorithm>

#include "line_of_sight.hpp"
#include "random.hpp"

namespace fleet2d {
namespace {

// start + change * elapsed / whole, rounded to nearest (halves up), while `elapsed` grows by `step`.
// The quotient and its remainder are carried along, so that only the first value costs a division.
class Ramp {
public:
    Ramp(i64 start, i64 change, i64 elapsed, i64 step, i64 whole) : size_(2 * whole) {
        const i64 doubled = 2 * change * elapsed + whole, growth = 2 * change * step;
        value_ = start + floor_div(doubled, size_);
        rest_ = floor_mod(doubled, size_);
        stride_ = floor_div(growth, size_);
        extra_ = floor_mod(growth, size_);
    }

    i64 value() const { return value_; }

    void advance() {
        value_ += stride_;
        rest_ += extra_;
        if (rest_ >= size_) {
            ++value_;
            rest_ -= size_;
        }
    }

private:
    i64 size_, value_, rest_, stride_, extra_;
};

bool is_same_pose(const Breakpoints& track, i64 a, i64 b) {
    return track.x[a] == track.x[b] && track.y[a] == track.y[b] &&
           turn_between(track.heading[a], track.heading[b]) == 0;
}

// Poses j to stop - 1: at breakpoint i.
void stand(const Breakpoints& track, i64 i, i64 j, i64 stop, const PosesToFill& out) {
    std::fill(out.x.begin() + j, out.x.begin() + stop, track.x[i]);
    std::fill(out.y.begin() + j, out.y.begin() + stop, track.y[i]);
    std::fill(out.heading.begin() + j, out.heading.begin() + stop, track.heading[i]);
    std::fill(out.away.begin() + j, out.away.begin() + stop, track.away[i]);
}

// Poses j to stop - 1: between breakpoints i and i + 1, at the times `moment`, moment + step, ...
void move(const Breakpoints& track, i64 i, i64 moment, i64 step, i64 j, i64 stop, const PosesToFill& out) {
    const i64 elapsed = moment - track.time[i], whole = track.time[i + 1] - track.time[i];
    step = std::min(step, whole);  // a longer one meets the leg once
    Ramp x(track.x[i], track.x[i + 1] - track.x[i], elapsed, step, whole);
    Ramp y(track.y[i], track.y[i + 1] - track.y[i], elapsed, step, whole);
    Ramp heading(track.heading[i], turn_between(track.heading[i], track.heading[i + 1]), elapsed, step, whole);
    for (i64 s = j; s < stop; ++s) {
        out.x[s] = x.value();
        out.y[s] = y.value();
        out.heading[s] = heading.value() & (TURN - 1);
        x.advance();
        y.advance();
        heading.advance();
    }
    std::fill(out.away.begin() + j, out.away.begin() + stop, track.away[i]);
}

// A body that wanders about in a space.
struct Wanderer {
    const Mesh& walls;
    const Mesh& space;
    Point at;
    i64 triangle;  // of the space, that holds it
    bool inside;   // strictly: a walked path may end on the very border of the space

    // Go straight to a point if that is free; whether it was.
    bool go(Point to) {
        if (inside) {
            if (inside_triangle(space, triangle, to.x, to.y)) {  // most steps are small
                at = to;
                return true;
            }
            if (!line_of_sight(space, at.x, at.y, triangle, to.x, to.y)) return false;
        } else {  // from the border, any way in is allowed
            if (!strictly_inside(space, to.x, to.y)) return false;
            if (!line_of_sight(walls, at.x, at.y, locate(walls, at.x, at.y), to.x, to.y)) return false;
        }
        at = to;
        triangle = locate(space, to.x, to.y);
        inside = true;
        return true;
    }
};

}  // namespace

i64 later(i64 now, f64 us) {
    us = std::ceil(us);
    return us < static_cast<f64>(LATEST - now) ? now + static_cast<i64>(us) : LATEST;
}

i64 last_breakpoint(View<const i64> time, i64 moment) {
    i64 low = 0, high = time.size();
    while (high - low > 1) {
        const i64 middle = (low + high) >> 1;
        if (time[middle] <= moment) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

bool is_traceable(const Breakpoints& track) {
    const auto is_small = [](i64 number, i64 most) { return -most <= number && number <= most; };
    const i64 count = track.size();
    for (const i64 size : {track.x.size(), track.y.size(), track.heading.size(), track.away.size()}) {
        if (size != count) return false;
    }
    for (i64 i = 0; i < count; ++i) {
        if (!is_small(track.time[i], LATEST) || !is_small(track.x[i], FARTHEST) || !is_small(track.y[i], FARTHEST) ||
            !is_small(track.heading[i], FARTHEST)) {
            return false;
        }
        if (i == 0) continue;
        if (track.time[i] < track.time[i - 1]) return false;
        const i64 turn = turn_between(track.heading[i - 1], track.heading[i]);
        const i64 change =
            std::max({std::abs(track.x[i] - track.x[i - 1]), std::abs(track.y[i] - track.y[i - 1]), std::abs(turn)});
        const f64 whole = static_cast<f64>(track.time[i] - track.time[i - 1]);
        if (static_cast<f64>(change) * whole > static_cast<f64>(LATEST)) return false;
    }
    return true;
}

void trace_track(const Breakpoints& track, i64 begin, i64 step, const PosesToFill& out) {
    const i64 count = out.size(), last = track.size() - 1;
    i64 i = last_breakpoint(track.time, begin);
    for (i64 j = 0; j < count;) {
        const i64 moment = begin + j * step;
        while (i < last && track.time[i + 1] <= moment) ++i;
        const bool begun = track.time[i] <= moment;  // until then it stands where it will start
        const i64 next = begun ? i + 1 : i;
        i64 stop = count;
        if (next <= last) stop = std::min(count, j + (track.time[next] - moment + step - 1) / step);
        if (!begun || i == last || is_same_pose(track, i, i + 1)) {
            stand(track, i, j, stop, out);  // most of a life
        } else {
            move(track, i, moment, step, j, stop, out);
        }
        j = stop;
    }
}

Array<i64, 2> time_route(View<const i64, 2> route, i64 begin, i64 heading, f64 speed, f64 turn_rate) {
    auto result = Array<i64, 2>::empty({2 * route.size(), 4});
    const View<i64, 2> rows = result;
    i64 count = 0;
    const auto add = [&](i64 time, i64 x, i64 y, i64 towards) {
        const i64 row[] = {time, x, y, towards};
        std::copy_n(row, 4, rows[count++].begin());
    };
    add(begin, route(0, 0), route(0, 1), heading);
    walk_route(route, begin, heading, speed, turn_rate, add);
    result.truncate(count);
    return result;
}

void trace_meander(const Mesh& walls, const Mesh& space, const WalkRule& rule, i64 first, Point start, i64 heading,
                   const PosesToFill& out) {
    constexpr u64 blocked = u64{1} << 62;  // draws for blocked steps are so far along the stream: no step's own is
    const i64 triangle = locate(space, start.x, start.y);
    Wanderer body{walls, space, start, triangle, triangle != OUTSIDE && !on_wall(space, triangle, start.x, start.y)};
    for (i64 j = 0; j < out.size(); ++j) {
        out.x[j] = body.at.x;
        out.y[j] = body.at.y;
        out.heading[j] = heading;
        out.away[j] = 0;
        const u64 step = static_cast<u64>(first) + static_cast<u64>(j);
        const i64 swing = (random_bell(rule.key, step) * rule.sway + 32768) >> 16;
        const i64 ahead = (heading + std::clamp(swing, -rule.turn_limit, rule.turn_limit)) & (TURN - 1);
        // A stride is in 1/256 lattice units and a cosine in 2**-30; rounded to nearest.
        const i64 dx = (rule.stride * cosine(ahead) + (i64{1} << 37)) >> 38;
        const i64 dy = (rule.stride * sine(ahead) + (i64{1} << 37)) >> 38;
        if (body.go({body.at.x + dx, body.at.y + dy}) || rule.stays != 0) {
            heading = ahead;
        } else {
            const u64 choices = static_cast<u64>(2 * rule.turn_limit + 1);
            const i64 turn = random_below(rule.key, blocked + step, choices) - rule.turn_limit;
            heading = (heading + turn) & (TURN - 1);
        }
    }
}

}  // namespace fleet2d
