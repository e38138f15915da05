#include "stays.hpp"

#include "subjects.hpp"

namespace fleet2d {

void bind_stays(nb::module_& m) {
    m.attr("WHOLE_PATCH") = WHOLE_PATCH;

    m.def(
        "merge_bins",
        [](View<const i64> minute, View<const i64> view, View<const i64> bin, View<const i64> patch,
           View<const i64> steps, i64 longest) {
            require(minute.size() == view.size(), "minute and view must be (bins,)");
            require(bin.size() == patch.size() && bin.size() == steps.size(),
                    "bin, patch and steps must have one length");
            require(all_in_range(bin, 0, view.size()) && std::is_sorted(bin.begin(), bin.end()),
                    "bin must ascend and hold numbers of bins");
            OwnedStretches result = merge_bins(minute, view, {bin, patch, steps}, longest);
            return std::tuple(std::move(result.bins), std::move(result.view), std::move(result.begin),
                              std::move(result.patch), std::move(result.share));
        },
        "minute"_a, "view"_a, "bin"_a, "patch"_a, "steps"_a, "longest"_a, Unlocked(),
        R"(Merge consecutive bins with the same view and the same sightings.

Bins in which the user was perceived in several patches aren't merged.

Args:
    minute: int64 (bins,), beginning of each bin [minutes since midnight]; no stretch crosses an
        hour.
    view: int64 (bins,), the row of `views`; consecutive bins with the same view have the same.
    bin: int64 (sightings,), ascending; where the user was perceived.
    patch: int64 (sightings,), ascending within each bin.
    steps: int64 (sightings,), number of steps with a sighting there.
    longest: Largest number of bins in a stretch.

Returns:
    The fields of `Stretches` without `views`.)");
    m.def(
        "follow",
        [](const StayModel& model, const Stretches& stretches, View<f64, 3> now, View<i64> shown) {
            check_stays(model, stretches);
            require(stretches.size() > 0, "there must be a stretch");
            require(now.shape == std::array{i64{2}, model.stages(), model.patches()} && shown.size() == model.patches(),
                    "now must be (2, stages, patches), shown (patches,)");
            return follow(model, stretches, now, shown);
        },
        "model"_a, "stretches"_a, "now"_a, "shown"_a, Unlocked(),
        R"(Return the distribution over rooms, given the evidence up to each stretch; see `smooth`.

Args:
    model: The transition probabilities of the person.
    stretches: The evidence, at least one stretch.
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
