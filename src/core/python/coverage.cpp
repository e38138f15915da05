#include "../coverage.hpp"

#include "lens.hpp"
#include "mesh.hpp"
#include "subjects.hpp"
#include "timelines.hpp"
#include "visible_cells.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<PoseCache> = 7;

template <>
inline constexpr std::size_t border::members_of<CoverageRecord> = 6;

template <>
inline constexpr std::size_t border::members_of<CoverageSetup> = 6;

namespace {

constexpr i64 LARGEST = i64{1} << 40;  // steps, or lattice units

void check_watched(const CoverageSetup& setup) {
    check_lenses(setup.lenses);
    for (i64 camera = 0; camera < setup.cameras(); ++camera) {
        check_reach(
            {setup.lenses.near_squared[camera], setup.lenses.far_squared[camera], setup.lenses.half_angle[camera]});
    }
    require(setup.step_us > 0, "step_us must be above 0");
    require(0 < setup.every && setup.every <= LARGEST && 0 < setup.bin_steps && setup.bin_steps <= LARGEST,
            "every and bin_steps must be in 1 to 2**40");
}

void check_glances(const PoseCache& cache) {
    const i64 slots = cache.slots(), poses = cache.poses();
    require(slots > 0 && (slots & (slots - 1)) == 0, "cache must have a power of two of slots");
    require(0 < poses && 2 * poses <= slots, "cache must have at least twice as many slots as poses");
    require(cache.pose.size() == poses && cache.pose.shape[1] == 4 && cache.settled.size() == poses &&
                cache.cells.size() == poses && cache.shown.size() == poses && cache.shown.shape[1] == 2 &&
                cache.used.size() == 1,
            "all arrays of cache but number must have one length; pose (poses, 4), shown (poses, 2), used (1,)");
    require(0 <= cache.used[0] && cache.used[0] <= poses, "used must be the number of poses that are");
}

bool is_grid(View<i64, 2> cells, const CoverageSetup& setup) { return cells.shape == setup.patch_of_cell.shape; }

void check_record(const CoverageSetup& setup, const CoverageRecord& record) {
    require((!record.keeps_first() || is_grid(record.first, setup)) &&
                (!record.keeps_last() || is_grid(record.last, setup)) &&
                (setup.cameras() <= 1 || is_grid(record.counted, setup)),
            "first, last and counted must be as large as patch_of_cell");
    require(record.peak.shape == record.binned.shape &&
                (!record.keeps_bins() || record.binned.shape[1] == record.patches()),
            "binned and peak must both be (bins, patches)");
}

void check_steps(const CoverageSetup& setup, const Window& window, i64 body, i64 first, i64 end,
                 const CoverageRecord& record) {
    require(0 <= body && body < window.bodies(), "there is no such body");
    require(window.first <= first && first <= end && end <= window.end, "the steps must lie within the window");
    require(all_in_range(window.x, -LARGEST, LARGEST) && all_in_range(window.y, -LARGEST, LARGEST),
            "bodies must be within 2**40 lattice units");
    require(0 <= first && end < LATEST / setup.step_us, "first must be a step, 0 or more");
    if (!record.keeps_bins() || first == end) return;
    const i64 reached = (end - 1) / setup.bin_steps - first / setup.bin_steps + 1;
    require(reached <= record.binned.size(), "binned must have a row for every bin that the steps reach");
}

}  // namespace

void bind_coverage(nb::module_& m) {
    m.attr("NEVER") = NEVER;
    m.def(
        "record_coverage",
        [](const CoverageSetup& setup, const Window& window, i64 body, i64 first, i64 end, const PoseCache& cache,
           const CoverageRecord& record) {
            check_watched(setup);
            check_glances(cache);
            check_record(setup, record);
            require(cache.cells.shape[1] == record.patches(), "cells must be (poses, patches)");
            check_steps(setup, window, body, first, end, record);
            record_coverage(setup, window, body, first, end, cache, record);
        },
        "setup"_a, "window"_a, "body"_a, "first"_a, "end"_a, "cache"_a, "record"_a, Unlocked(),
        R"(Record what a robot sees in the steps from `first` to `end` - 1.

Args:
    setup: Its cameras and the home, a `CoverageSetup`.
    window: The motion of the bodies.
    body: Number of the robot among the bodies.
    first: The first step.
    end: One past the last step.
    cache: The cached poses; emptied when it is full.
    record: What it has seen; `last` isn't updated for poses in the cache: see `settle_coverage`.)");
    m.def(
        "settle_coverage",
        [](const CoverageSetup& setup, const PoseCache& cache, View<i64, 2> seen) {
            check_watched(setup);
            check_glances(cache);
            require(all_in_range<i64>(cache.last, NEVER, LATEST / setup.step_us), "last must hold steps, or -1");
            require(is_grid(seen, setup), "seen must be as large as patch_of_cell");
            settle_coverage(setup, cache, seen);
        },
        "setup"_a, "cache"_a, "seen"_a, Unlocked(),
        R"(Update the last step of each cell for the poses in the cache.

Args:
    setup: Its cameras and the home, a `CoverageSetup`.
    cache: The cached poses.
    seen: Out: int64 (rows, columns), the last step at which each cell was in view, -1 for never.)");
}

}  // namespace fleet2d
