// The stays of a person as a hidden semi-Markov chain over patches of rooms: filtering.
//
// It uses no logarithms, no matrix products of libraries, and one order of sums, so that learned models, and
// the decisions of robots that follow from them, are the same on every machine.
//
// Rooms are all places to stay in; the last one is away. A stay passes through stages. A node is one
// stage of stays in one room, number room * stages + stage. A state is a node, a patch of its room,
// and whether the person is in the part of the patch that is in view, or hidden in the other part.
#pragma once

#include "array.hpp"

namespace fleet2d {

inline constexpr i64 WHOLE_PATCH = 255;   // value of `shown` for a patch that is completely in view
inline constexpr f64 FALSE_ALARM = 1e-3;  // likelihood of a sighting of a person who is elsewhere
inline constexpr f64 NEVER_SURE = 1e-12;  // least chance that a person in view isn't perceived, for any length

// Evidence of one user, with equal consecutive bins merged.
struct Stretches {
    View<const i64> bins;     // (stretches,) number of bins
    View<const i64> view;     // (stretches,) the row of `views`
    View<const u8, 2> views;  // (views, patches) part of each patch in view, in 1/255; 0 for away
    View<const i64> begin;    // (stretches + 1,) where each stretch's sightings begin in `patch` and `share`
    View<const i64> patch;    // (sightings,) where the user was perceived
    View<const f64> share;    // (sightings,) share of the steps with a sighting

    i64 size() const { return bins.size(); }
    View<const u8> shown(i64 t) const { return views[view[t]]; }
};

// The part of a patch in view, from 0 to 1.
inline f64 part_in_view(u8 shown) { return shown * (1.0 / WHOLE_PATCH); }

struct Range {
    i64 begin, end;
};

// The transition probabilities of a person: between stages of a stay, and between rooms.
struct StayModel {
    View<const f64> stay;       // (nodes,) probability of the same stage a bin later
    View<const f64, 2> follow;  // (nodes, rooms + 1) distribution after the stage: each room, and the next stage
    View<const f64> spread;     // (patches,) probability of the patch given that a person comes to its room
    View<const f64> restless;   // (rooms,) probability per bin of changing patch during a stay
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

// P(room) in each stretch, given the evidence up to it: (stretches, rooms). There must be a stretch.
//
// `now` (2, stages, patches) is the probability before the first stretch, of states in view and of hidden ones;
// `shown` (patches,) is the part of each patch that was in view before, -1 if unknown. They become those after the
// last.
Array<f64, 2> follow(const StayModel& model, const Stretches& stretches, View<f64, 3> now, View<i64> shown);

// Stretches that own their arrays, without the views.
struct OwnedStretches {
    Array<i64> bins;
    Array<i64> view;
    Array<i64> begin;
    Array<i64> patch;
    Array<f64> share;

    // The stretches, with the views whose numbers they have.
    Stretches of(View<const u8, 2> views) const { return {bins, view, views, begin, patch, share}; }
};

// Numbers of steps at which a user was perceived, by bin and patch, ascending, without zeros.
struct PatchCounts {
    View<const i64> bin;
    View<const i64> patch;
    View<const i64> steps;
};

// Merge at most `longest` consecutive bins with the same view and the same sightings.
//
// Bins in which the user was perceived in several patches aren't merged, and no stretch crosses an hour. `minute`
// (bins,) is the time since midnight; `view` (bins,) the number of the view, the same only if nothing changed.
OwnedStretches merge_bins(View<const i64> minute, View<const i64> view, const PatchCounts& seen, i64 longest);

}  // namespace fleet2d
