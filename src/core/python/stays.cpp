#include "stays.hpp"

#include "subjects.hpp"

namespace fleet2d {

void bind_stays(nb::module_& m) {
    m.attr("WHOLE_PATCH") = WHOLE_PATCH;

    m.def("take_together",
          [](View<const i64> minute, View<const u8, 2> shown, View<const i64, 2> seen, i64 longest) {
              require(minute.size() == shown.size() && seen.shape == shown.shape,
                      "minute must be (bins,), shown and seen (bins, patches)");
              OwnedStretches made = take_together(minute, shown, seen, longest);
              return std::tuple(std::move(made.bins), std::move(made.hour), std::move(made.shown),
                                std::move(made.begin), std::move(made.patch), std::move(made.share));
          },
          "minute"_a, "shown"_a, "seen"_a, "longest"_a, Unlocked());
    m.def("follow",
          [](const Ways& ways, const Stretches& stretches, View<f64, 3> now, View<i64> shown) {
              check_stays(ways, stretches);
              require(stretches.size() > 0, "there must be a stretch");
              require(now.shape == std::array{i64{2}, ways.stages(), ways.patches()} && shown.size() == ways.patches(),
                      "now must be (2, stages, patches), shown (patches,)");
              return follow(ways, stretches, now, shown);
          },
          "ways"_a, "stretches"_a, "now"_a, "shown"_a, Unlocked());
}

}  // namespace fleet2d
