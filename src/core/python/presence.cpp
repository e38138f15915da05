#include "../presence.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_presence(nb::module_& m) {
    m.def(
        "advance",
        [](View<const f64> probability, View<const f64, 2> transition, i64 bins) {
            require(transition.shape[0] == probability.size() && transition.shape[1] == probability.size(),
                    "transition must be (states, states)");
            return advance(probability, transition, bins);
        },
        "probability"_a, "transition"_a, "bins"_a, Unlocked(),
        R"(Return the state probabilities of a chain `bins` bins later, without evidence.

Args:
    probability: float64 (states,), the present probabilities.
    transition: float64 (states, states), from row to column within a bin.
    bins: How many bins.

Returns:
    float64 (states,).)");
    m.def(
        "resampled",
        [](u64 key, View<const f64, 2> days, i64 replicates) {
            require(days.size() < (i64{1} << 31), "days must be fewer than 2**31");
            require(replicates >= 0, "replicates must be 0 or more");
            return resampled(key, days, replicates);
        },
        nb::sig("def resampled(key: int | numpy.uint64, days: numpy.typing.NDArray[numpy.float64], replicates: int) -> "
                "numpy.typing.NDArray[numpy.float64]"),
        "key"_a, "days"_a, "replicates"_a, Unlocked(), R"(Sum days drawn with replacement.

Args:
    key: Of the stream of draws.
    days: float64 (days, values).
    replicates: How many sums.

Returns:
    float64 (replicates, values), each the sum of as many days as there are.)");
}

}  // namespace fleet2d
