// Evidence in bins of time: how much of each room and of each patch was in view; and sums of presence by hour.
#pragma once

#include <array>
#include <vector>

#include "array.hpp"

namespace fleet2d {

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
SightingCounts list_sightings(View<const i64> step, View<const i32> index, View<const i64> user, View<const i64> room,
                              i64 bin_steps, std::array<i64, 3> shape);

// The patches of rooms.
struct PatchSizes {
    View<const i64> room;        // (patches,) the room of each patch, ascending; every room has at least one
    View<const i64> cells;       // (patches,) cells of each
    View<const i64> room_cells;  // (rooms,) cells of each room, 1 at least
};

// How much was in view, bin by bin.
struct Views {
    Array<f64, 2> room_watched;   // (bins, rooms) share of cells in view, averaged over the steps of the bin
    Array<f64, 2> patch_watched;  // (bins, patches) the same by patches
    Array<f64, 2> shown;          // (bins, patches) largest share of the patch's cells in view at one step
    Array<u8, 2> shown_parts;     // (bins, patches) `shown` in parts of 255, a half to the even one
};

// Convert cells in view to shares. `cells` (bins, robots, 2, patches), each bin contiguous, are the sum over the steps
// of a bin, and the maximum; of several robots, the one that saw most counts.
Views gather_views(View<const i64, 4> cells, const PatchSizes& patches, i64 bin_steps);

// In how many steps users were perceived where: of each sighting arrays of one length.
struct PatchSightings {
    View<const i64> user, bin, patch, steps;
};

// What was in view in consecutive bins, each once.
struct WatchedViews {
    Array<i64> view;     // (bins,) the row of `views`
    Array<u8, 2> views;  // (views, patches + 1), each other than the one before; away, the last, is never in view
};

// What was in view but for patches with an unknown person, who may be any user: those are as if unwatched. `shown`
// (bins, patches) are parts in view. An unknown person was where anybody, the last of `users`, was perceived in more
// steps than all other users together; with one user only, everybody is the same person.
WatchedViews watched_views(View<const u8, 2> shown, const PatchSightings& sightings, i64 users);

// The probabilities of a person's places in consecutive stretches of bins.
struct Chain {
    View<const f64, 2> places;  // (stretches, places) probability of each place, away last
    View<const i64> bins;       // (stretches,) number of bins, at least 1
};

// Sum presence by hour, in the order in which NumPy's add.reduceat sums over the first axis.
//
// There is one chain for each user, all with the same number of bins. `unknown` (bins, places - 1) are the rooms with
// an unknown person. `first` are the bins at which hours begin, the first of them 0. Returns, for each hour, each user
// and last anyone (without users, the only chain is that of anyone), the sums of the probability p of each place, of p
// (1 - p), and of 1: (hours, users + 1, 2 places + 1).
Array<f64, 3> sum_places(const std::vector<Chain>& chains, View<const bool, 2> unknown, i64 users,
                         View<const i64> first);

}  // namespace fleet2d
