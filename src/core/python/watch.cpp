#include "../watch.hpp"

#include "lens.hpp"
#include "mesh.hpp"
#include "seen.hpp"
#include "subjects.hpp"
#include "timelines.hpp"

namespace fleet2d {

template <>
struct border::Fields<Glances> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members =
        std::tuple(&Glances::pose, &Glances::last, &Glances::settled, &Glances::cells, &Glances::used);
};

template <>
struct border::Fields<Record> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members =
        std::tuple(&Record::first, &Record::last, &Record::exposure, &Record::counted, &Record::binned, &Record::most);
};

template <>
struct border::Fields<Watched> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members = std::tuple(&Watched::walls, &Watched::lenses, &Watched::patch_of_cell,
                                               &Watched::step_us, &Watched::every, &Watched::bin_steps);
};

namespace {

constexpr i64 LONGEST = i64{1} << 40;  // every, bin_steps: steps

void check_watched(const Watched& watched) {
    check_lenses(watched.lenses);
    for (i64 camera = 0; camera < watched.cameras(); ++camera) {
        check_reach({watched.lenses.near_squared[camera], watched.lenses.far_squared[camera],
                     watched.lenses.half_angle[camera]});
    }
    require(watched.step_us > 0, "step_us must be above 0");
    require(0 < watched.every && watched.every <= LONGEST && 0 < watched.bin_steps && watched.bin_steps <= LONGEST,
            "every and bin_steps must be in 1 to 2**40");
}

void check_glances(const Glances& glances) {
    const i64 slots = glances.slots();
    require(slots > 0 && (slots & (slots - 1)) == 0, "glances must have a power of two of slots");
    require(glances.pose.size() == slots && glances.pose.shape[1] == 4 && glances.settled.size() == slots &&
                glances.cells.size() == slots && glances.used.size() == 1,
            "all arrays of glances must have one length, that of the slots; pose (slots, 4), used (1,)");
    require(0 <= glances.used[0] && glances.used[0] <= slots, "used must be the number of slots that are");
}

bool is_grid(View<i64, 2> cells, const Watched& watched) { return cells.shape == watched.patch_of_cell.shape; }

void check_record(const Watched& watched, const Record& record) {
    require(is_grid(record.first, watched) && (!record.keeps_last() || is_grid(record.last, watched)) &&
                (watched.cameras() <= 1 || is_grid(record.counted, watched)),
            "first, last and counted must be as large as patch_of_cell");
    require(record.most.shape == record.binned.shape &&
                (!record.keeps_bins() || record.binned.shape[1] == record.patches()),
            "binned and most must both be (bins, patches)");
}

void check_steps(const Watched& watched, const Window& window, i64 body, i64 first, i64 end, const Record& record) {
    require(0 <= body && body < window.bodies(), "there is no such body");
    require(window.first <= first && first <= end && end <= window.end, "the steps must lie within the window");
    require(all_in_range(window.x, -LONGEST, LONGEST) && all_in_range(window.y, -LONGEST, LONGEST),
            "bodies must be within 2**40 lattice units");
    require(0 <= first && end < LATEST / watched.step_us, "first must be a step, 0 or more");
    if (!record.keeps_bins() || first == end) return;
    const i64 reached = (end - 1) / watched.bin_steps - first / watched.bin_steps + 1;
    require(reached <= record.binned.size(), "binned must have a row for every bin that the steps reach");
}

}  // namespace

void bind_watch(nb::module_& m) {
    m.attr("NEVER") = NEVER;
    m.def(
        "watch",
        [](const Watched& watched, const Window& window, i64 body, i64 first, i64 end, const Glances& glances,
           const Record& record) {
            check_watched(watched);
            check_glances(glances);
            check_record(watched, record);
            require(glances.cells.shape[1] == record.patches(), "cells must be (slots, patches)");
            check_steps(watched, window, body, first, end, record);
            watch(watched, window, body, first, end, glances, record);
        },
        "watched"_a, "window"_a, "body"_a, "first"_a, "end"_a, "glances"_a, "record"_a, Unlocked(),
        R"(Take in what a robot sees in the steps from `first` to `end` - 1.

Args:
    watched: What it sees it with, and where, a `Watched`.
    window: How bodies move.
    body: Number of the robot among them.
    first: The first step.
    end: One past the last step.
    glances: The poses kept so far, `Glances`; emptied when the table is half full.
    record: What it has seen, a `Record`; `last` lags behind where a pose comes again: see `settle`.)");
    m.def(
        "settle",
        [](const Watched& watched, const Glances& glances, View<i64, 2> seen) {
            check_watched(watched);
            check_glances(glances);
            require(all_in_range<i64>(glances.last, NEVER, LATEST / watched.step_us), "last must hold steps, or -1");
            require(is_grid(seen, watched), "seen must be as large as patch_of_cell");
            settle(watched, glances, seen);
        },
        "watched"_a, "glances"_a, "seen"_a, Unlocked(),
        R"(Bring the last step of each cell up to date with poses that were taken again.

Args:
    watched: What the robot sees with, and where, a `Watched`.
    glances: The poses kept so far, `Glances`.
    seen: Out: int64 (rows, columns), the last step at which each cell was in view, -1 for never.)");
}

}  // namespace fleet2d
