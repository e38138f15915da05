// Forecasts of presence, and resampled days: no logarithm, and one order of sums.
//
// BLAS and einsum add in an order that depends on the machine. These loops don't, so what is learned,
// and where a robot goes because of it, is the same everywhere.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "lattice.hpp"
#include "random.hpp"

namespace fleet2d {

// A chain's state probabilities some bins later, without evidence, (states,), by its transitions,
// (states, states), from row to column.
inline Array<f64> advance(View<const f64> probability, View<const f64, 2> transition, i64 bins) {
    const i64 states = probability.size();
    auto now = Array<f64>::copy_of(probability), later = Array<f64>::empty({states});
    for (i64 bin = 0; bin < bins; ++bin) {
        std::fill_n(later.data(), states, 0.0);
        for (i64 i = 0; i < states; ++i) {
            const f64 share = now[i];
            const View<const f64> row = transition[i];
            for (i64 j = 0; j < states; ++j) later[j] += share * row[j];
        }
        std::swap(now, later);
    }
    return now;
}

// Sums of days drawn with replacement, (replicates, values), each of as many as there are: `days` is
// (days, values), `key` that of the stream of draws.
inline Array<f64, 2> resampled(u64 key, View<const f64, 2> days, i64 replicates) {
    const i64 count = days.shape[0], values = days.shape[1];
    auto sums = Array<f64, 2>::zeros({replicates, values});
    for (i64 b = 0; b < replicates; ++b) {
        const u64 draws = random_bits(key, static_cast<u64>(b));
        const View<f64> sum = sums[b];
        for (i64 d = 0; d < count; ++d) {
            const View<const f64> day = days[random_below(draws, static_cast<u64>(d), static_cast<u64>(count))];
            for (i64 v = 0; v < values; ++v) sum[v] += day[v];
        }
    }
    return sums;
}

}  // namespace fleet2d
