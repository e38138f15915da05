// What a robot has seen over time: the steps at which it saw each cell, and how much of each room for how long.
//
// A robot stands most of the time, and it returns to the same poses on its rounds, so the view of a pose is cached:
// the number of cells of each room, and the last step at which the robot had the pose. The cells themselves are
// computed again when the last steps are needed.
#pragma once

#include "lens.hpp"
#include "timelines.hpp"

namespace fleet2d {

inline constexpr i64 NEVER = -1;
inline constexpr i64 LAST_MOMENT = i64{1} << 62;  // us: no step begins later

// The cached poses, one after the other as the robot came to them: its ways pass the same ones, which are then near
// each other in memory. An open hash table, whose length is a power of two, has twice as many slots.
struct PoseCache {
    View<i32> number;    // (slots,) the number of the pose in each slot; NEVER for an empty slot
    View<i64, 2> pose;   // (poses, 4) x, y [lattice units], heading, and how far the cameras are panned
    View<i64> last;      // (poses,) the last step with the pose
    View<i64> settled;   // (poses,) the last such step that is in CoverageRecord::last
    View<i32, 2> cells;  // (poses, patches) cells of each patch in view
    View<i32, 2> shown;  // (poses, 2) the first patch in view, and one past the last
    View<i64> used;      // (1,) number of poses that are cached

    i64 slots() const { return number.size(); }
    i64 poses() const { return last.size(); }
};

// What a robot has seen since the start. A patch is a room, or a part of one.
struct CoverageRecord {
    View<i64, 2> first;    // (rows, columns) the first step at which each cell was in view, or NEVER; empty: not kept
    View<i64, 2> last;     // (rows, columns) the last such step as far as `settle_coverage` was called; empty: not kept
    View<i64> exposure;    // (patches,) cells of each patch in view, summed over the steps
    View<i64, 2> counted;  // (rows, columns) the last look that counted each cell; empty for a single camera
    View<i64, 2> binned;   // (bins, patches) as `exposure`, by time: `record_coverage` sets as many anew as its steps
                           // reach; empty: not kept
    View<i64, 2> peak;     // (bins, patches) the most cells of each patch in view at a step, likewise

    i64 patches() const { return exposure.size(); }
    bool keeps_first() const { return first.size() > 0; }
    bool keeps_last() const { return last.size() > 0; }
    bool keeps_bins() const { return binned.size() > 0; }
};

// The constants of a robot's coverage.
struct CoverageSetup {
    Mesh walls;
    Lenses lenses;                     // the robot's cameras
    View<const i16, 2> patch_of_cell;  // (rows, columns) -1 for a cell of no patch
    i64 step_us;                       // length of a step
    i64 every;                         // it looks at multiples of this step; each look counts for this many steps
    i64 bin_steps;                     // steps of a bin of CoverageRecord::binned; bins begin at step 0

    i64 cameras() const { return lenses.near_squared.size(); }
};

// Record what a robot, which is a body of a window, sees in the steps first to end - 1. The cache is emptied when it
// is full. `record.last` isn't updated for poses in the cache: see `settle_coverage`.
void record_coverage(const CoverageSetup& setup, const Window& window, i64 body, i64 first, i64 end,
                     const PoseCache& cache, const CoverageRecord& record);

// Update `seen`, the last step of each cell, for the poses in the cache.
void settle_coverage(const CoverageSetup& setup, const PoseCache& cache, View<i64, 2> seen);

}  // namespace fleet2d
