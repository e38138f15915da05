// Evidence in bins of time: how much of each room and of each patch was in view; and what presence adds up to.
#pragma once

#include <tuple>
#include <vector>

#include "array.hpp"

namespace fleet2d {

// The patches that rooms are cut into.
struct PatchSizes {
    View<const i64> room;        // (patches,) the room of each, ascending; every room has one
    View<const i64> cells;       // (patches,) cells of each
    View<const i64> room_cells;  // (rooms,) cells of each room, 1 at least
};

// How much was in view, bin by bin.
struct Views {
    Array<f64, 2> room_watched;   // (bins, rooms) share of cells in view, averaged over the steps of the bin
    Array<f64, 2> patch_watched;  // (bins, patches) the same by patches
    Array<f64, 2> shown;          // (bins, patches) share of the patch's cells in view at one step, at most
    Array<u8, 2> shown_parts;     // (bins, patches) `shown` in parts of 255, a half to the even one
};

// Bring cells in view into shares. `cells` (bins, robots, 2, patches) are summed over the steps of a bin, and at most
// at one step, and lie in one piece; of several robots, the one that saw most counts.
Views gather_views(View<const i64, 4> cells, const PatchSizes& patches, i64 bin_steps);

// Where a person was in consecutive stretches of bins.
struct Chain {
    View<const f64, 2> places;  // (stretches, places) probability of each place, away last
    View<const i64> bins;       // (stretches,) how many bins each has, 1 at least
};

// Sum what presence adds up by hour, in the order in which NumPy's add.reduceat sums over the first axis.
//
// There is a chain of each user, all of as many bins. `unknown` (bins, places - 1) says in which rooms somebody was
// who is no user. `first` are the bins at which hours begin, the first of them 0. Of each hour come, for each user and
// for anyone (a last one, unless there is but one chain and `users` is 0), the sums of the probability p of each place,
// of p (1 - p), and of 1: (hours, users + 1, 2 places + 1).
Array<f64, 3> sum_places(const std::vector<Chain>& chains, View<const bool, 2> unknown, i64 users,
                         View<const i64> first);

}  // namespace fleet2d
