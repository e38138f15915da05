#include "stays.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "lattice.hpp"
#include "people.hpp"

namespace fleet2d {

f64 whole_power(f64 base, i64 exponent) {
    f64 result = 1.0;
    for (; exponent > 0; exponent >>= 1) {
        if (exponent & 1) result *= base;
        base *= base;
    }
    return result;
}

Array<bool, 2> rooms_in_view(const StayModel& model, View<const u8, 2> views) {
    auto result = Array<bool, 2>::zeros({views.size(), model.rooms()});
    for (i64 view = 0; view < views.size(); ++view) {
        for (i64 room = 0; room < model.rooms(); ++room) {
            const auto [begin, end] = model.patches_of(room);
            for (i64 p = begin; p < end; ++p) result(view, room) |= views(view, p) > 0;
        }
    }
    return result;
}

namespace {

// Follow a group; `places` (stretches, rooms), zeros, become P(room), and `now` (2, stages, patches) what is after the
// last stretch.
template <int W>
void follow_group(const Group<W>& group, Filtered<W>& filtered, const std::array<View<f64, 2>, W>& places,
                  const std::array<View<f64, 3>, W>& now) {
    const StayModel& layout = group.layout();
    const i64 count = group.steps();
    Steps<W> steps(group);
    ForwardPass<W> pass(group, steps, filtered);
    pass.run();
    for (std::size_t lane = 0; lane < static_cast<std::size_t>(group.people); ++lane) {
        for (i64 t = 0; t < places[lane].size(); ++t) {
            const View<const Lanes<W>> mass = filtered.mass[t + 1];
            const View<f64> row = places[lane][t];
            for (i64 k = 0; k < layout.nodes(); ++k) row[k / layout.stages()] += mass[k][lane];
        }
        for (i64 stage = 0; stage < layout.stages(); ++stage) {
            for (i64 p = 0; p < layout.patches(); ++p) {
                now[lane](0, stage, p) = filtered.in_view(count, stage, p)[lane];
                now[lane](1, stage, p) = filtered.hidden(count, stage, p)[lane];
            }
        }
    }
}

}  // namespace

Array<f64, 2> follow(const StayModel& model, const Stretches& stretches, View<f64, 3> now, View<i64> shown) {
    const i64 count = stretches.size();
    const Array<bool, 2> in_view = rooms_in_view(model, stretches.views);
    auto places = Array<f64, 2>::zeros({count, model.rooms()});
    Filtered<1> filtered;
    follow_group<1>({1, {model}, {stretches}, in_view, {now}, {shown}}, filtered, {places.view()}, {now});
    const View<const u8> last = stretches.shown(count - 1);
    std::copy(last.begin(), last.end(), shown.begin());
    return places;
}

namespace {

// The patches in which a user was perceived in a bin.
struct BinSightings {
    i64 begin = 0;  // the first of them among the sightings
    i64 end = 0;
    i64 patch = -1;  // the last of them; -1: none

    i64 patches() const { return end - begin; }
};

// Whether two bins can be merged: with the same sighting.
bool alike(BinSightings sightings, BinSightings before) {
    return sightings.patches() < 2 && before.patches() < 2 && sightings.patch == before.patch;
}

}  // namespace

OwnedStretches merge_bins(View<const i64> minute, View<const i64> view, const PatchCounts& seen, i64 longest) {
    struct Opening {
        i64 bin;  // the first of a stretch
        BinSightings sighting;
    };
    std::vector<Opening> openings;
    BinSightings before;
    i64 sightings = 0;
    const i64 bins = view.size();
    for (i64 t = 0; t < bins; ++t) {
        BinSightings now{before.end, before.end, -1};
        for (; now.end < seen.bin.size() && seen.bin[now.end] == t; ++now.end) now.patch = seen.patch[now.end];
        const bool goes_on = t > 0 && t - openings.back().bin < longest &&
                             floor_div(minute[openings.back().bin], 60) == floor_div(minute[t], 60) &&
                             view[t] == view[t - 1] && alike(now, before);
        if (!goes_on) {
            openings.push_back({t, now});
            sightings += now.patches();
        }
        before = now;
    }

    const i64 count = static_cast<i64>(openings.size());
    OwnedStretches result;
    result.bins = Array<i64>::empty({count});
    result.view = Array<i64>::empty({count});
    result.begin = Array<i64>::zeros({count + 1});
    result.patch = Array<i64>::empty({sightings});
    result.share = Array<f64>::empty({sightings});
    i64 used = 0, end = bins;
    for (i64 i = count - 1; i >= 0; --i) {
        const i64 bin = openings[static_cast<std::size_t>(i)].bin;
        result.bins[i] = end - bin;
        end = bin;
    }
    for (i64 i = 0; i < count; ++i) {
        const auto [bin, sighting] = openings[static_cast<std::size_t>(i)];
        result.view[i] = view[bin];
        f64 total = 0.0;
        for (i64 k = sighting.begin; k < sighting.end; ++k) total += static_cast<f64>(seen.steps[k]);
        for (i64 k = sighting.begin; k < sighting.end; ++k) {
            result.patch[used] = seen.patch[k];
            result.share[used] = static_cast<f64>(seen.steps[k]) / total;
            ++used;
        }
        result.begin[i + 1] = used;
    }
    return result;
}

std::vector<OwnedStretches> DayEvidence::stretches(i64 people, i64 longest) const {
    std::vector<OwnedStretches> result;
    for (i64 person = 0; person < people; ++person) {
        const auto [begin, end] = sightings_of(person);
        const auto own = [begin = begin, end = end](View<const i64> all) { return all.slice(begin, end); };
        result.push_back(merge_bins(minute, view, {own(bin), own(patch), own(steps)}, longest));
    }
    return result;
}

PeoplePlaces PeoplePlaces::of(const std::vector<OwnedStretches>& stretches, i64 rooms) {
    PeoplePlaces result;
    result.begin = Array<i64>::zeros({static_cast<i64>(stretches.size()) + 1});
    i64 count = 0, person = 0;
    for (const OwnedStretches& own : stretches) result.begin[++person] = count += own.bins.size();
    result.places = Array<f64, 2>::zeros({count, rooms});
    result.bins = Array<i64>::empty({count});
    i64* next = result.bins.data();
    for (const OwnedStretches& own : stretches) next = std::copy_n(own.bins.data(), own.bins.size(), next);
    return result;
}

Array<f64, 3> all_hidden(View<const f64, 2> places) {
    auto result = Array<f64, 3>::zeros({2, places.size(), places.shape[1]});
    for (i64 stage = 0; stage < places.size(); ++stage) {
        std::copy(places[stage].begin(), places[stage].end(), result[1][stage].begin());
    }
    return result;
}

PeoplePlaces follow_people(const PeopleModel& model, const DayEvidence& day, i64 longest, View<f64, 3> now) {
    const std::vector<OwnedStretches> stretches = day.stretches(model.size(), longest);
    PeoplePlaces result = PeoplePlaces::of(stretches, model.restless.shape[1]);
    if (model.size() == 0) return result;
    const SharedViews shared(model.of(0), day.views);
    in_groups(model.size(), [&]<int W>(Filtered<W>& filtered, i64 first) {
        const auto of = [&](i64 lane) { return person_of(lane, first, model.size()); };
        auto states = for_lanes<W>([&](i64 lane) { return all_hidden(now[of(lane)]); });
        const Group<W> group = group_of<W>(model, stretches, shared, first, states);
        const auto places = for_lanes<W>([&](i64 lane) { return result.of(of(lane)); });
        const auto after = for_lanes<W>([&](i64 lane) { return states[static_cast<std::size_t>(lane)].view(); });
        side_by_side<W>([&] { follow_group<W>(group, filtered, places, after); });
        for (std::size_t lane = 0; lane < static_cast<std::size_t>(group.people); ++lane) {
            const View<f64, 2> after = now[first + static_cast<i64>(lane)];
            for (i64 stage = 0; stage < after.size(); ++stage) {
                for (i64 p = 0; p < after.shape[1]; ++p) {
                    after(stage, p) = states[lane](0, stage, p) + states[lane](1, stage, p);
                }
            }
        }
    });
    return result;
}

namespace {

// The sum of numbers as NumPy adds up a row: eight sums side by side, and halves of more than 128 numbers apart.
f64 sum_of(View<const f64> numbers) {
    const i64 count = numbers.size();
    if (count > 128) {
        const i64 half = count / 2 - count / 2 % 8;
        return sum_of(numbers.slice(0, half)) + sum_of(numbers.slice(half, count));
    }
    f64 sum = 0.0;
    i64 i = 0;
    if (count >= 8) {
        std::array<f64, 8> part{};
        for (; i < count - count % 8; ++i) part[static_cast<std::size_t>(i % 8)] += numbers[i];
        sum = ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
    }
    for (; i < count; ++i) sum += numbers[i];
    return sum;
}

// How often a person went to each place, and once to one of them before anything was learned: (rooms,).
Array<f64> entries(View<const f64, 2> exits, View<const f64> possible) {
    const i64 rooms = possible.size();
    auto entered = Array<f64>::zeros({rooms});
    for (i64 k = 0; k < exits.size(); ++k) {
        for (i64 room = 0; room < rooms; ++room) entered[room] += exits(k, room);
    }
    const f64 places = sum_of(possible);
    for (i64 room = 0; room < rooms; ++room) entered[room] += possible[room] / places;
    return entered;
}

// Set where stays go on after each stage, and how likely it lasts for another bin.
void learn_stays(const KnownMoments& moments, i64 person, const StayPrior& prior, View<f64> stay, View<f64, 2> follow) {
    const i64 rooms = prior.possible.size(), stages = prior.length.size();
    const Array<f64> entered = entries(moments.exits[person], prior.possible);
    for (i64 room = 0; room < rooms; ++room) {
        auto others = Array<f64>::copy_of(entered);
        others[room] = 0.0;
        const f64 total = sum_of(others);
        for (i64 stage = 0; stage < stages; ++stage) {
            const i64 k = room * stages + stage;
            const View<const f64> exits = moments.exits[person][k];
            const f64 ends = sum_of(exits) + 1.0, onward = stage + 1 < stages ? 0.5 : 0.0;
            stay[k] = 1.0 - ends / (moments.time(person, k) + prior.length[stage]);
            for (i64 to = 0; to < rooms; ++to) {
                follow(k, to) = (exits[to] + others[to] / total * (1.0 - onward)) / ends;
            }
            follow(k, rooms) = (exits[rooms] + onward) / ends;
        }
    }
}

// Set which patches people come to, and how likely they change patch.
void learn_patches(const KnownMoments& moments, i64 person, const StayPrior& prior, View<f64> spread,
                   View<f64> restless) {
    const View<const f64> arrivals = moments.arrivals[person], moves = moments.moves[person];
    const View<const f64> rests = moments.rests[person];
    const i64 rooms = prior.possible.size();
    for (i64 room = 0; room < rooms; ++room) {
        const i64 begin = prior.first[room], end = prior.first[room + 1];
        f64 total = 0.0;
        for (i64 p = begin; p < end; ++p) total += spread[p] = arrivals[p] + prior.spread[p];
        for (i64 p = begin; p < end; ++p) spread[p] /= total;
        const f64 trials = moves[room] + rests[room] + 1.0 / std::max(prior.restless, 1e-6);
        restless[room] = std::min((moves[room] + 1.0) / std::max(trials, 1.0), 1.0);
    }
    restless[rooms - 1] = 0.0;  // away has no patches
}

}  // namespace

LearnedStays learned_stays(const KnownMoments& moments, const StayPrior& prior) {
    LearnedStays learned{Array<f64, 2>::empty(moments.time.shape), Array<f64, 3>::empty(moments.exits.shape),
                         Array<f64, 2>::empty(moments.arrivals.shape), Array<f64, 2>::empty(moments.moves.shape)};
    for (i64 person = 0; person < moments.time.size(); ++person) {
        learn_stays(moments, person, prior, learned.stay[person], learned.follow[person]);
        learn_patches(moments, person, prior, learned.spread[person], learned.restless[person]);
    }
    return learned;
}

}  // namespace fleet2d
