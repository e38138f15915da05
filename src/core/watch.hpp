// What a robot has seen over time: when it saw each cell, and how much of each room for how long.
//
// Most of the time a robot stands, and on its rounds it comes by the same poses again, so what a pose shows is
// kept: how many cells of each room, and the last step at which the pose was taken. The cells themselves are
// found again when somebody asks which were seen last.
#pragma once

#include "lens.hpp"
#include "timelines.hpp"

namespace fleet2d {

inline constexpr i64 NEVER = -1;
inline constexpr i64 LAST_MOMENT = i64{1} << 62;  // us: no step begins later

// The poses kept, in an open hash table; a power of two long, and at most half full.
struct Glances {
    View<i64, 2> pose;   // (slots, 4) x, y [lattice units], heading, and how far the cameras are panned
    View<i64> last;      // (slots,) the last step at which it was taken; NEVER for an empty slot
    View<i64> settled;   // (slots,) the last such step that Record::last knows of
    View<i32, 2> cells;  // (slots, patches) cells of each patch that it shows
    View<i64> used;      // (1,) how many slots are used

    i64 slots() const { return last.size(); }
};

// What a robot has seen since the start. A patch is a room, or part of one.
struct Record {
    View<i64, 2> first;    // (rows, columns) the first step at which each cell was in view, or NEVER
    View<i64, 2> last;     // (rows, columns) the last such step as far as `settle` was called; empty: not kept
    View<i64> exposure;    // (patches,) cells of each patch in view, summed over the steps
    View<i64, 2> counted;  // (rows, columns) the last look that counted each cell; empty for a single camera
    View<i64, 2> binned;   // (bins, patches) as `exposure`, by time: `watch` sets as many anew as its steps reach;
                           // empty: not kept
    View<i64, 2> most;     // (bins, patches) the most cells of each patch in view at a step, likewise

    i64 patches() const { return exposure.size(); }
    bool keeps_last() const { return last.size() > 0; }
    bool keeps_bins() const { return binned.size() > 0; }
};

// What doesn't change while a robot watches.
struct Watched {
    Mesh walls;
    Lenses lenses;                     // the robot's cameras
    View<const i16, 2> patch_of_cell;  // (rows, columns) -1 for a cell of no patch
    i64 step_us;                       // length of a step
    i64 every;                         // it looks at the steps that this divides; each look stands for so many
    i64 bin_steps;                     // steps of a bin of Record::binned; bins begin at step 0

    i64 cameras() const { return lenses.near_squared.size(); }
};

// Take in what the robot that is a body of a window sees in the steps first to end - 1. `glances` are emptied when
// the table is half full. `record.last` lags behind where a pose comes again: see `settle`.
void watch(const Watched& watched, const Window& window, i64 body, i64 first, i64 end, const Glances& glances,
           const Record& record);

// Bring `seen`, the last step of each cell, up to date with poses that were taken again.
void settle(const Watched& watched, const Glances& glances, View<i64, 2> seen);

}  // namespace fleet2d
