// The breakpoints of a plan, which is built leg by leg.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "motion.hpp"
#include "random.hpp"

namespace fleet2d {

// The end of a plan so far.
struct Moment {
    i64 time;     // us
    i64 x, y;     // lattice units
    i64 heading;  // 1/4096 turn
    i64 away;     // 1 = not at home
};

// Quantiles of the time between two events [us]: a power of two of them, not all 0.
struct Waits {
    std::vector<i64> quantiles;

    i64 draw(StepDraws& draws, Bits& bits) const;
};

// How a body turns aside now and then.
struct Aside {
    i64 facing;          // 1/4096 turn
    u64 side_bits;       // headings are within 2**(side_bits - 1) of that
    const Waits& waits;  // between two turns
};

class Legs {
public:
    // A breakpoint.
    void mark(const Moment& now) { rows_.push_back({now.time, now.x, now.y, now.heading, now.away}); }

    // Turn on the spot by a number of headings, counter-clockwise if positive; at most a third of a turn between
    // two breakpoints, so that the shorter way is the one meant. Returns where it ends.
    Moment turn(Moment now, i64 headings, f64 turn_rate);

    // Turn aside at random moments: first at `next` [us], and then after waits, as long as that is before `until`.
    // Each turn is to a heading within 2**(side_bits - 1) of `facing`. Returns where it ends, and when the next turn
    // is due.
    std::pair<Moment, i64> turn_aside(Moment now, f64 turn_rate, const Aside& aside, i64 next, i64 until,
                                      StepDraws& draws, Bits& bits);

    // Walk along a route (n, 2), as `time_route`, at home. Returns where it ends.
    Moment walk(Moment now, View<const i64, 2> route, f64 speed, f64 turn_rate);

    // Walk straight to a point, if it is another one. Returns where it ends.
    Moment step_to(Moment now, Point at, f64 speed, f64 turn_rate);

    // The same, and turn to a heading there. Returns where it ends.
    Moment settle(Moment now, Point at, i64 heading, f64 speed, f64 turn_rate);

    i64 size() const { return static_cast<i64>(rows_.size()); }
    // The last breakpoint of at least one.
    Moment last() const {
        const auto& [time, x, y, heading, away] = rows_.back();
        return {time, x, y, heading, away};
    }
    // All breakpoints, (n, 5).
    Array<i64, 2> rows() const;
    // One column of them.
    template <class T>
    Array<T> column(std::size_t number) const {
        auto result = Array<T>::empty({size()});
        for (i64 i = 0; i < size(); ++i) result[i] = static_cast<T>(rows_[static_cast<std::size_t>(i)][number]);
        return result;
    }

private:
    std::vector<std::array<i64, 5>> rows_;  // time, x, y, heading, away
};

}  // namespace fleet2d
