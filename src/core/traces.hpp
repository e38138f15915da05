// Traces: what the evidence of a person leaves behind, place by place, as features of a learned model; and that model.
//
// Only sums, products, quotients and exact scalings: logarithms and exponentials are series, so that beliefs, and where
// a robot goes because of them, are the same everywhere.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "array.hpp"

namespace fleet2d {

inline constexpr i64 TRACE_FEATURES = 25;
inline constexpr i64 DAY_HOURS = 24;
inline constexpr f64 LONG_AGO = -1e9;         // [min]
inline constexpr f64 LONGEST_GAP = 2 * 1440;  // [min]

// Minutes since an earlier time, up to the longest that count; 0 while a clock that was put back reads times again.
inline f64 gap_of(f64 time, f64 before) { return std::clamp(time - before, 0.0, LONGEST_GAP); }

// The natural logarithm of a number above 0, to about 1e-9.
inline f64 ln(f64 x) {
    int exponent = 0;
    f64 m = std::frexp(x, &exponent);
    if (m < 0.7071067811865476) m *= 2, --exponent;
    const f64 s = (m - 1) / (m + 1), square = s * s;
    f64 series = 1.0 / 13;
    for (const f64 odd : {11.0, 9.0, 7.0, 5.0, 3.0, 1.0}) series = series * square + 1 / odd;
    return exponent * 0.6931471805599453 + 2 * s * series;
}

// e to the power of x, for x from -700 to 0; 0 below.
inline f64 exp_of(f64 x) {
    if (x < -700) return 0;
    const f64 n = std::floor(x * 1.4426950408889634 + 0.5), r = x - n * 0.6931471805599453;
    f64 power = 1;
    for (f64 k = 10; k > 0; --k) power = 1 + r / k * power;
    return std::ldexp(power, static_cast<int>(n));
}

// What doesn't change during a run.
struct TracedRooms {
    View<const f64> share;        // (rooms,) of the floor
    View<const f64, 2> distance;  // (rooms, rooms) [10 m]

    i64 size() const { return share.size(); }
    i64 state_size() const { return 3 + 6 * size() + 2 * DAY_HOURS * size() + size() * size() + 2 * DAY_HOURS; }
};

// The evidence of one person in consecutive bins.
struct TracedEvidence {
    View<const i64> day;         // (bins,) as date.toordinal counts
    View<const i64> minute;      // (bins,) of the day
    View<const f64, 2> watched;  // (bins, rooms) share of the room in view
    View<const f64, 2> seen;     // (bins, rooms) share of the steps at which the person was perceived
    View<const u8, 2> unknown;   // (bins, rooms) whether an unknown person was perceived
    View<const f64, 2> belief;   // (bins, rooms + 1) of another model, away last
};

// The traces of one person: a view of memory that Python owns, of `TracedRooms::state_size` numbers.
struct Traces {
    i64 rooms;
    f64 *last, *last_time, *first_time;  // the room of the newest sighting, and times [min]
    f64 *seen_at, *looked_at;            // (rooms,) [min]
    f64 *empty_most, *empty_sum;         // (rooms,) share, and bins, seen empty since the newest sighting
    f64 *empty_10, *empty_60;            // (rooms,) the same with exponential forgetting
    f64 *seen, *watched;                 // (24, rooms) bins by hour of the day
    f64* moves;                          // (rooms, rooms) from sighting to sighting
    f64 *gone, *bins;                    // (24,) bins without a sighting in a home that was seen empty, and all

    Traces(View<f64> memory, i64 rooms_) : rooms(rooms_) {
        f64* next = memory.data;
        const auto take = [&next](i64 count) { return std::exchange(next, next + count); };
        last = take(1), last_time = take(1), first_time = take(1);
        seen_at = take(rooms), looked_at = take(rooms), empty_most = take(rooms), empty_sum = take(rooms);
        empty_10 = take(rooms), empty_60 = take(rooms);
        seen = take(DAY_HOURS * rooms), watched = take(DAY_HOURS * rooms), moves = take(rooms * rooms);
        gone = take(DAY_HOURS), bins = take(DAY_HOURS);
    }

    void begin(f64 time) {
        *last = -1, *last_time = LONG_AGO, *first_time = time;
        std::fill_n(seen_at, rooms, LONG_AGO);
        std::fill_n(looked_at, rooms, LONG_AGO);
    }
};

// Add a bin of evidence, and write what the traces say of each place then: `row` is (rooms + 1, TRACE_FEATURES).
inline void trace_bin(Traces& traces, const TracedRooms& home, const TracedEvidence& evidence, i64 bin,
                      View<f64, 2> row) {
    const i64 rooms = home.size(), minute = evidence.minute[bin];
    const i64 hour = std::min<i64>(minute / 60, DAY_HOURS - 1);
    const f64 time = static_cast<f64>(evidence.day[bin]) * 1440 + static_cast<f64>(minute);
    if (*traces.first_time == 0) traces.begin(time);
    const View<const f64> watched = evidence.watched[bin], seen = evidence.seen[bin];
    const auto best = std::max_element(seen.begin(), seen.end());
    const bool is_seen = best != seen.end() && *best > 0;
    if (is_seen) {
        const i64 room = best - seen.begin(), before = static_cast<i64>(*traces.last);
        if (before >= 0 && (room != before || time - *traces.last_time > 1)) traces.moves[before * rooms + room] += 1;
        *traces.last = static_cast<f64>(room), *traces.last_time = time;
        std::fill_n(traces.empty_most, rooms, 0.0);
        std::fill_n(traces.empty_sum, rooms, 0.0);
    }
    f64 cover = 0, most_empty = 0, empty_floor = 0;
    for (i64 r = 0; r < rooms; ++r) {
        const f64 empty = seen[r] > 0 ? 0 : watched[r];
        if (seen[r] > 0) traces.seen_at[r] = time;
        if (watched[r] > 0.5) traces.looked_at[r] = time;
        traces.empty_most[r] = std::max(traces.empty_most[r], empty), traces.empty_sum[r] += empty;
        traces.empty_10[r] = traces.empty_10[r] * 0.905 + empty;
        traces.empty_60[r] = traces.empty_60[r] * 0.9835 + empty;
        traces.seen[hour * rooms + r] += seen[r], traces.watched[hour * rooms + r] += watched[r];
        cover += home.share[r] * traces.empty_most[r];
        empty_floor += home.share[r] * traces.empty_sum[r];
        most_empty = std::max(most_empty, traces.empty_most[r]);
    }
    const f64 gap = gap_of(time, *traces.last_time), log_gap = ln(1 + gap);
    traces.gone[hour] += cover > 0.6 && gap > 5 ? 1 : 0, traces.bins[hour] += 1;

    // Over all hours, and in this one and its neighbours.
    std::vector<f64> all(static_cast<std::size_t>(rooms)), near(static_cast<std::size_t>(rooms));
    f64 all_sum = 0, near_sum = 0, sightings = 0;
    for (i64 r = 0; r < rooms; ++r) {
        f64 seen_all = 0, watched_all = 0, seen_near = 0, watched_near = 0;
        for (i64 h = 0; h < DAY_HOURS; ++h)
            seen_all += traces.seen[h * rooms + r], watched_all += traces.watched[h * rooms + r];
        for (const i64 h : {hour, (hour + DAY_HOURS - 1) % DAY_HOURS, (hour + 1) % DAY_HOURS})
            seen_near += traces.seen[h * rooms + r], watched_near += traces.watched[h * rooms + r];
        const f64 rate = (seen_all + 1) / (watched_all + 10);
        const auto at = static_cast<std::size_t>(r);
        all[at] = rate, near[at] = (seen_near + 30 * rate) / (watched_near + 30);
        all_sum += all[at], near_sum += near[at], sightings += seen_all;
        row(r, 12) = seen_all;
    }
    const i64 last = static_cast<i64>(*traces.last);
    f64 moves = 0;
    for (i64 r = 0; last >= 0 && r < rooms; ++r) moves += traces.moves[last * rooms + r] + 0.5;
    for (i64 r = 0; r < rooms; ++r) {
        const auto at = static_cast<std::size_t>(r);
        const bool is_last = r == last;
        row(r, 0) = is_last, row(r, 1) = is_last ? log_gap : 0;
        row(r, 2) = ln(1 + gap_of(time, traces.seen_at[r]));
        row(r, 3) = seen[r];
        row(r, 4) = ln(1 + gap_of(time, traces.looked_at[r]));
        row(r, 5) = traces.empty_most[r];
        row(r, 6) = ln(1 + traces.empty_sum[r]);
        row(r, 7) = ln(1 + traces.empty_10[r]), row(r, 8) = ln(1 + traces.empty_60[r]);
        row(r, 9) = watched[r];
        row(r, 10) = ln(all[at] / all_sum), row(r, 11) = ln(near[at] / near_sum);
        row(r, 12) /= sightings + 1;
        row(r, 13) = last >= 0 ? ln((traces.moves[last * rooms + r] + 0.5) / moves) : 0;
        row(r, 14) = last >= 0 ? home.distance(last, r) : 0;
        row(r, 15) = evidence.unknown(bin, r);
    }
    f64 gone = 0, bins = 0;
    for (i64 h = 0; h < DAY_HOURS; ++h) gone += traces.gone[h], bins += traces.bins[h];
    row(rooms, 16) = (traces.gone[hour] + 1) / (traces.bins[hour] + 4), row(rooms, 17) = (gone + 1) / (bins + 4);
    // No time of day: hours mean something by what was seen at them. People of the training sleep at night, others
    // don't.
    const std::array<f64, 6> shared{log_gap,
                                    cover,
                                    ln(1 + std::max(time - *traces.first_time, 0.0) / 1440),
                                    is_seen ? 1.0 : 0.0,
                                    most_empty,
                                    ln(1 + empty_floor)};
    for (i64 place = 0; place <= rooms; ++place) {
        for (std::size_t k = 0; k < shared.size(); ++k) row(place, 18 + static_cast<i64>(k)) = shared[k];
        row(place, 24) = ln(std::max(evidence.belief(bin, place), 1e-6));
    }
}

// What the traces say of each place after each bin: (bins, rooms + 1, TRACE_FEATURES). `memory` is updated.
inline Array<f64, 3> trace_evidence(View<f64> memory, const TracedRooms& home, const TracedEvidence& evidence) {
    auto features = Array<f64, 3>::zeros({evidence.day.size(), home.size() + 1, TRACE_FEATURES});
    Traces traces(memory, home.size());
    for (i64 bin = 0; bin < evidence.day.size(); ++bin) trace_bin(traces, home, evidence, bin, features.view()[bin]);
    return features;
}

// A network over the set of places: each place passes two layers, the second of which knows the mean over all places.
struct PlaceNetwork {
    View<const f64, 2> first;    // (features, hidden)
    View<const f64, 2> second;   // (hidden, hidden)
    View<const f64, 2> context;  // (hidden, hidden)
    View<const f64> bias;        // (hidden,) of the second layer
    View<const f64> score;       // (hidden,)
};

// Adds to `sum` a row of weights for each input that isn't zero.
inline void add_weighted(View<const f64> inputs, View<const f64, 2> weights, f64* sum) {
    const i64 width = weights.shape[1];
    for (i64 i = 0; i < inputs.size(); ++i) {
        const f64 input = inputs[i];
        if (input == 0) continue;
        const f64* row = &weights(i, 0);
        for (i64 j = 0; j < width; ++j) sum[j] += input * row[j];
    }
}

// The probability of each place in each bin, (bins, places), from features (bins, places, features) and what the first
// layer makes of the places themselves, (places, hidden). The last feature, the logarithm of another model's belief, is
// what the network corrects.
inline Array<f64, 2> place_probabilities(const PlaceNetwork& network, View<const f64, 2> places,
                                         View<const f64, 3> features) {
    const i64 bins = features.size(), count = features.shape[1], hidden = network.bias.size();
    auto probability = Array<f64, 2>::zeros({bins, count});
    auto inner = Array<f64, 2>::zeros({count, hidden});
    auto mean = Array<f64>::zeros({hidden}), shared = Array<f64>::zeros({hidden}), outer = Array<f64>::zeros({hidden});
    for (i64 bin = 0; bin < bins; ++bin) {
        std::fill_n(mean.data(), hidden, 0.0);
        for (i64 p = 0; p < count; ++p) {
            f64* row = &inner(p, 0);
            std::copy_n(&places(p, 0), hidden, row);
            add_weighted(features[bin][p], network.first, row);
            for (i64 j = 0; j < hidden; ++j) row[j] = std::max(row[j], 0.0), mean[j] += row[j];
        }
        for (i64 j = 0; j < hidden; ++j) mean[j] /= static_cast<f64>(count), shared[j] = network.bias[j];
        add_weighted(mean.view(), network.context, shared.data());
        const View<f64> row = probability.view()[bin];
        for (i64 p = 0; p < count; ++p) {
            std::copy_n(shared.data(), hidden, outer.data());
            add_weighted(inner.view()[p], network.second, outer.data());
            row[p] = features(bin, p, features.shape[2] - 1);
            for (i64 j = 0; j < hidden; ++j) row[p] += std::max(outer[j], 0.0) * network.score[j];
        }
        const f64 most = *std::max_element(row.begin(), row.end());
        f64 sum = 0;
        for (f64& value : row) value = exp_of(value - most), sum += value;
        for (f64& value : row) value /= sum;
    }
    return probability;
}

}  // namespace fleet2d
