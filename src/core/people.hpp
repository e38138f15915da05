// The chains of all people of a run, one day at a time: what they share of its evidence is passed once.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "chains.hpp"
#include "smoothing.hpp"

namespace fleet2d {

// The transition probabilities of people who live in the same rooms, as in StayModel.
struct PeopleModel {
    View<const f64, 2> stay;      // (people, nodes)
    View<const f64, 3> follow;    // (people, nodes, rooms + 1)
    View<const f64, 2> spread;    // (people, patches)
    View<const f64, 2> restless;  // (people, rooms)
    View<const i64> first;        // (rooms + 1,)
    f64 detection = 0;

    i64 size() const { return stay.size(); }
    StayModel of(i64 person) const {
        return {stay[person], follow[person], spread[person], restless[person], first, detection};
    }
};

// The evidence of a day: what is the same for all people, and where each was perceived.
struct DayEvidence {
    View<const i64> minute;   // (bins,) since midnight
    View<const i64> view;     // (bins,) the row of `views`
    View<const u8, 2> views;  // (views, patches), as in Stretches
    View<const i64> user;     // (sightings,) ascending; other users than the people are left out
    View<const i64> bin;      // (sightings,) ascending for each user: as in PatchCounts
    View<const i64> patch;    // (sightings,)
    View<const i64> steps;    // (sightings,)

    // Begin and end of a person's sightings.
    std::pair<i64, i64> sightings_of(i64 person) const {
        const auto [first, last] = std::equal_range(user.begin(), user.end(), person);
        return {first - user.begin(), last - user.begin()};
    }

    // The stretches of each person, of `longest` bins at most.
    std::vector<OwnedStretches> stretches(i64 people, i64 longest) const;
};

// Moments of people, as in Moments.
struct PeopleMoments {
    View<f64, 2> time;      // (people, nodes)
    View<f64, 3> exits;     // (people, nodes, rooms + 1)
    View<f64, 2> arrivals;  // (people, patches)
    View<f64, 2> moves;     // (people, rooms)
    View<f64, 2> rests;     // (people, rooms)

    Moments of(i64 person) const {
        return {time[person], exits[person], arrivals[person], moves[person], rests[person]};
    }
};

// What was learned of people, as in PeopleMoments.
struct KnownMoments {
    View<const f64, 2> time;
    View<const f64, 3> exits;
    View<const f64, 2> arrivals;
    View<const f64, 2> moves;
    View<const f64, 2> rests;
};

// What is assumed of people before anything is learned.
struct StayPrior {
    View<const f64> length;    // (stages,) mean length of each stage of a stay [bins]
    View<const f64> spread;    // (patches,) share of each patch in its room, above 0
    View<const f64> possible;  // (rooms,) 1 for the places where people may be, 0 for the others
    View<const i64> first;     // (rooms + 1,) as in StayModel
    f64 restless = 0;          // probability per bin of changing patch
};

// The most probable transitions, as in PeopleModel.
struct LearnedStays {
    Array<f64, 2> stay;
    Array<f64, 3> follow;
    Array<f64, 2> spread, restless;
};

// Return the most probable transitions: expected counts by expected time, with one event of each kind before.
LearnedStays learned_stays(const KnownMoments& moments, const StayPrior& prior);

// Where people were in their stretches.
struct PeoplePlaces {
    Array<f64, 2> places;  // (stretches of all people, rooms) P(room) in each
    Array<i64> bins;       // (stretches of all people,) number of bins
    Array<i64> begin;      // (people + 1,) where each person's stretches begin

    // Room for the stretches of each person, all zeros.
    static PeoplePlaces of(const std::vector<OwnedStretches>& stretches, i64 rooms);

    View<f64, 2> of(i64 person) {
        const i64 rooms = places.shape()[1];
        return {places.data() + begin[person] * rooms, {begin[person + 1] - begin[person], rooms}};
    }
};

struct PeopleSmoothed {
    PeoplePlaces where;
    Array<f64, 3> end;    // (people, stages, patches), as in Smoothed
    Array<f64, 3> ahead;  // (people, stages, patches)
};

// `follow` for each person, from stretches of `longest` bins at most, when no view is known before. `now` (people,
// stages, patches) is the probability of each patch before, and then after.
PeoplePlaces follow_people(const PeopleModel& model, const DayEvidence& day, i64 longest, View<f64, 3> now);

// `smooth` for each person; `prior` and `future` are (people, stages, patches).
PeopleSmoothed smooth_people(const PeopleModel& model, const DayEvidence& day, i64 longest, View<const f64, 3> prior,
                             View<const f64, 3> future, const PeopleMoments& moments);

// Call `work(filtered, first)` for groups of people from `first` on; `filtered` is memory for a group of that size. The
// last group may lack people: if it is more than half full, that is quicker than smaller groups.
template <class Work>
void in_groups(i64 people, Work work) {
    i64 first = 0;
    const auto go_on = [&]<int W>(Filtered<W> filtered) {
        for (; widest() >= W && 2 * (people - first) > W; first += W) work(filtered, first);
    };
    go_on(Filtered<8>());
    go_on(Filtered<4>());
    go_on(Filtered<1>());
}

// An array of what a function returns for each lane.
template <int W, class Make>
auto for_lanes(Make make) {
    return [&]<std::size_t... L>(std::index_sequence<L...>) {
        return std::array{make(static_cast<i64>(L))...};
    }(std::make_index_sequence<static_cast<std::size_t>(W)>{});
}

// The probability of hidden states only, as patches are not in view yet: (2, stages, patches).
Array<f64, 3> all_hidden(View<const f64, 2> places);

// What all people of a day share.
struct SharedViews {
    View<const u8, 2> views;  // as in Stretches
    Array<bool, 2> in_view;   // (views, rooms) whether something of the room is in view
    Array<i64> unknown;       // (patches,) -1

    SharedViews(const StayModel& layout, View<const u8, 2> views_)
        : views(views_), in_view(rooms_in_view(layout, views_)), unknown(Array<i64>::filled({layout.patches()}, -1)) {}
};

// The person of a lane: the last one, too, stands in for those that a group lacks.
inline i64 person_of(i64 lane, i64 first, i64 people) { return std::min(first + lane, people - 1); }

// The group of people from `first` on; `now` as in Group.
template <int W>
Group<W> group_of(const PeopleModel& model, const std::vector<OwnedStretches>& stretches, const SharedViews& shared,
                  i64 first, const std::array<Array<f64, 3>, W>& now) {
    const auto of = [&](i64 lane) { return person_of(lane, first, model.size()); };
    return {std::min(model.size() - first, i64{W}),
            for_lanes<W>([&](i64 lane) { return model.of(of(lane)); }),
            for_lanes<W>([&](i64 lane) { return stretches[static_cast<std::size_t>(of(lane))].of(shared.views); }),
            shared.in_view.view(),
            for_lanes<W>([&](i64 lane) { return now[static_cast<std::size_t>(lane)].view(); }),
            for_lanes<W>([&](i64) { return shared.unknown.view(); })};
}

}  // namespace fleet2d
