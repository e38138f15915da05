// Forecasts of presence, sightings and resampled days: no logarithm, and one order of sums.
//
// BLAS and einsum add in an order that depends on the machine. These loops don't, so what is learned,
// and where a robot goes because of it, is the same everywhere.
#pragma once

#include <algorithm>
#include <tuple>
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

// At how many steps of each bin users were perceived in each room, where that isn't 0: arrays of one length, by user,
// bin and room, ascending.
struct SightingCounts {
    Array<i64> user, bin, room, steps;
};

// Count the steps at which each user was perceived in each room, once however often.
//
// `step` (n,) is in order of time, from the beginning of the first bin. Most sightings repeat another one at another
// step: `index` (n,) is the number of each among the distinct ones, of which `user` (k,) is below 0 for somebody
// unknown, and `room` (k,) below 0 for none. `shape` is (bins, users + 1, rooms); its last user is anybody.
inline SightingCounts list_sightings(View<const i64> step, View<const i32> index, View<const i64> user,
                                     View<const i64> room, i64 bin_steps, std::array<i64, 3> shape) {
    struct Entry {
        i64 user, bin, room, steps, last;  // the step that was counted last
    };
    std::vector<Entry> entries;
    const auto [bins, users, rooms] = shape;
    auto newest = Array<i64, 2>::filled({users, rooms}, -1);  // entry
    i64 bin = -1, begin = 0;                                  // of the bin
    for (i64 i = 0, next = 0; i < step.size(); i = next) {
        const i64 at = step[i], number = index[i];
        if (bin < 0 || at < begin || at - begin >= bin_steps) {
            bin = floor_div(at, bin_steps);
            if (bin >= bins) bin = -1;
            begin = std::max(bin, i64{0}) * bin_steps;
        }
        // While nobody moves, the same sighting repeats at the next steps of the bin.
        const auto repeats = [&](i64 k) {
            return index[k] == number && step[k] > step[k - 1] && step[k] - begin < bin_steps;
        };
        next = i + 1;
        if (bin < 0 || room[number] < 0) continue;
        while (next < step.size() && repeats(next)) ++next;
        for (const i64 who : {user[number], users - 1}) {
            if (who < 0) continue;
            i64& known = newest(who, room[number]);
            if (known < 0 || entries[static_cast<std::size_t>(known)].bin != bin) {
                known = static_cast<i64>(entries.size());
                entries.push_back({who, bin, room[number], 0, -1});
            }
            Entry& entry = entries[static_cast<std::size_t>(known)];
            entry.steps += next - i - (entry.last == at ? 1 : 0);
            entry.last = step[next - 1];
        }
    }
    std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
        return std::tie(a.user, a.bin, a.room) < std::tie(b.user, b.bin, b.room);
    });
    const std::array<i64, 1> count{static_cast<i64>(entries.size())};
    SightingCounts made{Array<i64>::empty(count), Array<i64>::empty(count), Array<i64>::empty(count),
                        Array<i64>::empty(count)};
    for (i64 i = 0; i < count[0]; ++i) {
        const Entry& entry = entries[static_cast<std::size_t>(i)];
        made.user[i] = entry.user, made.bin[i] = entry.bin, made.room[i] = entry.room, made.steps[i] = entry.steps;
    }
    return made;
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
