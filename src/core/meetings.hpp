// Meetings: when bodies on their ways would come too near to others.
//
// The ways are those of the timelines: straight stretches between breakpoints, and steps of random walks. Two bodies
// meet when the distance of their middles falls below a limit while they approach, or when they overlap and don't part.
#pragma once

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

// For each of some bodies, the first meeting that is due in the steps first to end - 1; of several that are due at a
// step, the earliest, and then that with the lowest row. Bodies without one are left out.
std::vector<Meeting> meetings(Timelines& timelines, View<const i64> rows, const Distances& distances, i64 first,
                              i64 end);

// The first meeting in the steps first to end - 1 of a body that follows a track from step `first` on. All distances
// are those of row 0.
std::optional<Meeting> meeting_on(Timelines& timelines, i64 row, const TrackPiece& track, const Distances& distances,
                                  i64 first, i64 end);

}  // namespace fleet2d
