// Stays of a person, hidden or seen: a semi-Markov chain over patches of rooms, filtered.
//
// No logarithm, no library's product, and one order of sums: what is learned, and where a robot goes
// because of it, is the same on every machine.
//
// Rooms are all places to stay in; the last one is away. A stay passes through stages. A node is one
// stage of stays in one room, number room * stages + stage. A state is a node, a patch of its room,
// and whether the person is in the part of the patch that is in view, or hidden in the other part.
#pragma once

#include "array.hpp"

namespace fleet2d {

inline constexpr i64 WHOLE_PATCH = 255;   // what is shown of a patch that is in view as a whole
inline constexpr f64 FALSE_ALARM = 1e-3;  // weight of the chance that a person perceived in a patch is elsewhere
inline constexpr f64 NEVER_SURE = 1e-12;  // least chance that a person in view isn't perceived, however long

// Evidence of one user; bins that are alike are taken together.
struct Stretches {
    View<const i64> bins;     // (stretches,) how many bins each has
    View<const i64> hour;     // (stretches,) of the day
    View<const u8, 2> shown;  // (stretches, patches) what part of each patch was in view, in 1/255; away never is
    View<const i64> begin;    // (stretches + 1,) where each stretch's sightings begin in `patch` and `share`
    View<const i64> patch;    // (sightings,) where the user was perceived
    View<const f64> share;    // (sightings,) at what share of the steps with a sighting

    i64 size() const { return bins.size(); }
};

// What part of a patch is in view, from 0 to 1.
inline f64 part_in_view(u8 shown) { return shown * (1.0 / WHOLE_PATCH); }

struct Range {
    i64 begin, end;
};

// How a person goes on: from stage to stage of a stay, and from room to room.
struct Ways {
    View<const f64> stay;       // (nodes,) chance to be in the same stage a bin later
    View<const f64, 2> follow;  // (nodes, rooms + 1) where a person goes after the stage: each room, and the next stage
    View<const f64> spread;     // (patches,) chance that a person who comes to its room comes to the patch
    View<const f64> restless;   // (rooms,) chance a bin that a person who stays in a room changes patch
    View<const i64> first;      // (rooms + 1,) the first patch of each room, and the number of patches
    f64 detection = 0;          // chance that a person in view is perceived in a bin

    i64 nodes() const { return stay.size(); }
    i64 rooms() const { return restless.size(); }
    i64 stages() const { return nodes() / rooms(); }
    i64 patches() const { return spread.size(); }
    i64 node(i64 room, i64 stage) const { return room * stages() + stage; }
    i64 next_stage() const { return rooms(); }  // its column in `follow`
    Range patches_of(i64 room) const { return {first[room], first[room + 1]}; }
};

// What a person does within a stretch, for each length that stretches have.
struct Transitions {
    Array<i64> length;    // (stretches,) the number of each stretch's length
    Array<f64, 2> over;   // (lengths, nodes) chance that the stage is over
    Array<f64, 2> rest;   // (lengths, nodes) chance to be in the same stage, without a change of patch
    Array<f64, 2> hop;    // (lengths, nodes) chance to be in the same stage, after a change of patch
    Array<f64, 3> leave;  // (lengths, nodes, rooms + 1) chance to go on to each room, and to the next stage
    Array<f64> missed;    // (lengths,) chance that a person in view isn't perceived
};

// What the evidence up to each stretch says of a person; number 0 is before the first stretch.
//
// Robots look into few rooms at a time. Where `visible` is false nothing of the room is in view, and
// `in_view` is 0: that half of the states can be left out, and no sum changes.
struct Filtered {
    Transitions transitions;
    Array<f64, 3> in_view;   // (stretches + 1, stages, patches) probability of each state in view
    Array<f64, 3> hidden;    // (stretches + 1, stages, patches) probability of each hidden state
    Array<bool, 2> visible;  // (stretches + 1, rooms) whether the person may be in view in the room
    Array<f64, 2> mass;      // (stretches + 1, nodes) probability of each node
    Array<f64, 2> likely;    // (stretches, 2) how well states in view, and hidden ones, explain no sighting in them
    Array<f64> scale;        // (stretches,) factor that made probabilities sum to one
    Array<bool, 2> same;     // (stretches, patches) whether as much of the patch is in view as before
};

// Filter some stretches; `smooth` says by which rules.
//
// `now` (2, stages, patches) is the probability before the first stretch, of states in view and of hidden ones;
// `shown` (patches,) is what part of each patch was in view before, -1 if that isn't known.
Filtered filter_stays(const Ways& ways, const Stretches& stretches, View<const f64, 3> now, View<const i64> shown);

// P(room) in each stretch, given the evidence up to it: (stretches, rooms). There must be a stretch.
// `now` and `shown` are those of `filter_stays`; they become those after the last stretch.
Array<f64, 2> follow(const Ways& ways, const Stretches& stretches, View<f64, 3> now, View<i64> shown);

// Weigh states (stages, patches) by the sightings in a stretch. They speak for states in view, or for hidden ones
// in a patch of which nothing is in view: positions may be noisy. `likely` (2,) is that of Filtered.
void weigh_sightings(const Stretches& stretches, i64 t, View<const f64> likely, View<f64, 2> in_view,
                     View<f64, 2> hidden);

// Stretches that own their arrays.
struct OwnedStretches {
    Array<i64> bins;
    Array<i64> hour;
    Array<u8, 2> shown;
    Array<i64> begin;
    Array<i64> patch;
    Array<f64> share;
};

// At how many steps of each bin a user was perceived in each patch, where that isn't 0; by bin and patch, ascending.
struct PatchCounts {
    View<const i64> bin;
    View<const i64> patch;
    View<const i64> steps;
};

// Take together bins in which the same was in view and the user was perceived alike, at most `longest`.
//
// Bins in which the user was perceived in several patches stay by themselves, and no stretch goes on into another
// hour. `minute` (bins,) is that since midnight; `shown` (bins, patches) as in Stretches, without away.
OwnedStretches take_together(View<const i64> minute, View<const u8, 2> shown, const PatchCounts& seen, i64 longest);

}  // namespace fleet2d
