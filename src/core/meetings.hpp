// Meetings: when bodies on their ways would come too near to others.
//
// The ways are those of the timelines: straight stretches between breakpoints, and steps of random walks. Two bodies
// meet when the distance of their middles falls below a limit while they approach, or when they overlap and don't part.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "timelines.hpp"

namespace fleet2d {

// A meeting of a body with another one.
struct Meeting {
    i64 row;    // of the body
    i64 due;    // step at which it has to react: as many steps ahead as it keeps, but not before the first one
    i64 step;   // in which they meet
    i64 other;  // the row of the other one
};

// Whose motion brings two bodies too near to each other.
enum MotionCounts : u8 {
    ALL_MOTION = 0,
    OWN_MOTION = 1,    // only that of the body itself: the other one may come as near as it likes
    OTHER_MOTION = 2,  // only that of the other one
};

// What each of some bodies keeps from all bodies, (rows, bodies) each.
struct Distances {
    View<const i64, 2> lead;   // steps by which it reacts before a meeting; below 0: it ignores the other one
    View<const i64, 2> near;   // distance of the middles below which they mustn't approach [lattice units]
    View<const i64, 2> hard;   // distance below which they overlap, and must part [lattice units]; 0: they needn't
    View<const u8, 2> counts;  // whose motion counts: a MotionCounts
};

// A straight stretch of a way, from one moment to another.
struct Straight {
    i64 begin, end;   // us; the part of it that counts
    i64 from, whole;  // us; when it began, and how long it takes in all; 0 at rest
    Point at;         // where it began
    i64 dx, dy;
    bool away;

    Point where(i64 moment) const {
        if (whole == 0) return at;
        const i64 elapsed = moment - from;
        return {at.x + floor_div(2 * dx * elapsed + whole, 2 * whole),
                at.y + floor_div(2 * dy * elapsed + whole, 2 * whole)};
    }
};

// The way of a body, and the smallest box around it.
struct Way {
    static constexpr i64 ENDLESS = std::numeric_limits<i64>::max();

    std::vector<Straight> straights;
    i64 x0 = ENDLESS, y0 = ENDLESS, x1 = -ENDLESS, y1 = -ENDLESS;

    void add(const Straight& straight) {
        if (straight.begin >= straight.end) return;
        straights.push_back(straight);
        if (straight.away) return;
        x0 = std::min({x0, straight.at.x, straight.at.x + straight.dx});
        y0 = std::min({y0, straight.at.y, straight.at.y + straight.dy});
        x1 = std::max({x1, straight.at.x, straight.at.x + straight.dx});
        y1 = std::max({y1, straight.at.y, straight.at.y + straight.dy});
    }
    // The first straight that isn't over at a moment.
    std::vector<Straight>::const_iterator from(i64 moment) const {
        return std::ranges::upper_bound(straights, moment, {}, &Straight::end);
    }
    bool is_near(const Way& other, i64 distance) const {
        return x0 <= x1 && other.x0 <= other.x1 && x0 - distance <= other.x1 && other.x0 - distance <= x1 &&
               y0 - distance <= other.y1 && other.y0 - distance <= y1;
    }
};

// The ways of all bodies over some steps, as far as they are known.
class KnownWays {
public:
    // Take in the ways over the steps first to end - 1. Those that are known already are kept.
    void update(Timelines& timelines, i64 first, i64 end);

    // Whom a body would meet first if it followed a track from the first step on. All distances are those of row 0, and
    // no lead is above 0.
    std::optional<Meeting> meeting(i64 row, const TrackPiece& track, const Distances& distances) const;

private:
    i64 first_ = 0, end_ = 0, step_us_ = 1;
    std::vector<Way> ways_;
    std::vector<i64> changes_;  // of each body, when its way was taken in
};

// Looks for meetings again and again, as time goes on and bodies change their ways. What is known of two bodies that
// didn't is kept.
class MeetingSearch {
public:
    // For each of some bodies, the first meeting that is due in the steps first to end - 1; of several that are due at
    // a step, the earliest, and then that with the lowest row. Bodies without one are left out.
    std::vector<Meeting> run(Timelines& timelines, View<const i64> rows, const Distances& distances, i64 first,
                             i64 end);

private:
    // The way of a body in some steps, at least.
    struct KnownWay {
        i64 changes = -1, first = 0, end = 0;
        Way way;
    };
    // Where two bodies meet first in some steps; -1 for nowhere.
    struct KnownMeeting {
        i64 changes = -1, other_changes = -1;
        i64 near = 0, hard = 0, counts = 0;
        i64 first = 0, end = 0, step = -1;

        bool has_limits_of(const KnownMeeting& other) const {
            return near == other.near && hard == other.hard && counts == other.counts;
        }
    };

    const Way& way_of(Timelines& timelines, i64 body, i64 first, i64 end);
    i64 first_step(Timelines& timelines, i64 row, i64 other, const KnownMeeting& wanted);

    std::vector<KnownWay> ways_;
    // Of body b and other o: number b * bodies + o. The distances of a pair alternate between two: those that it keeps,
    // and those at which it stops at the last moment.
    std::vector<std::array<KnownMeeting, 2>> known_;
};

}  // namespace fleet2d
