#include "stays.hpp"

#include "subjects.hpp"

namespace fleet2d {

void bind_stays(nb::module_& m) {
    m.attr("WHOLE_PATCH") = WHOLE_PATCH;

    m.def(
        "take_together",
        [](View<const i64> minute, View<const u8, 2> shown, View<const i64> bin, View<const i64> patch,
           View<const i64> steps, i64 longest) {
            require(minute.size() == shown.size(), "minute must be (bins,), shown (bins, patches)");
            require(bin.size() == patch.size() && bin.size() == steps.size(),
                    "bin, patch and steps must have one length");
            require(all_in_range(bin, 0, shown.size()) && all_in_range(patch, 0, shown.shape[1]) &&
                        std::is_sorted(bin.begin(), bin.end()),
                    "bin must ascend and hold numbers of bins, patch numbers of patches");
            OwnedStretches made = take_together(minute, shown, {bin, patch, steps}, longest);
            return std::tuple(std::move(made.bins), std::move(made.hour), std::move(made.shown), std::move(made.begin),
                              std::move(made.patch), std::move(made.share));
        },
        "minute"_a, "shown"_a, "bin"_a, "patch"_a, "steps"_a, "longest"_a, Unlocked(),
        "Take together bins that are alike; see `fleet2d.kernels.stays`.");
    m.def(
        "follow",
        [](const Ways& ways, const Stretches& stretches, View<f64, 3> now, View<i64> shown) {
            check_stays(ways, stretches);
            require(stretches.size() > 0, "there must be a stretch");
            require(now.shape == std::array{i64{2}, ways.stages(), ways.patches()} && shown.size() == ways.patches(),
                    "now must be (2, stages, patches), shown (patches,)");
            return follow(ways, stretches, now, shown);
        },
        "ways"_a, "stretches"_a, "now"_a, "shown"_a, Unlocked(),
        R"(Return where a person was, given the evidence up to each stretch; see `smooth`.

Args:
    ways: How the person goes on.
    stretches: The evidence, of one stretch at least.
    now: float64 (2, stages, patches), probability before the first stretch, of states in view and
        of hidden ones; becomes that after the last.
    shown: int64 (patches,), what part of each patch was in view before, in 1/255, -1 if that isn't
        known; becomes that of the last.

Returns:
    P(room), away last, in each stretch: float64 (stretches, rooms + 1).

Raises:
    ValueError: Arrays aren't of one person, or hold numbers of patches or sightings that aren't.)");
}

}  // namespace fleet2d
