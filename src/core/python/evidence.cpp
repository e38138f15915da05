#include "../evidence.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

namespace {

// Whether numbers ascend from 0, by one at most, to `count` - 1.
bool numbers_all(View<const i64> rooms, i64 count) {
    i64 next = 0;
    for (const i64 room : rooms) {
        if (room != next && room != next - 1) return false;
        if (room == next) ++next;
    }
    return next == count;
}

bool begins(View<const i64> first, i64 bins) {
    for (i64 h = 0; h < first.size(); ++h) {
        if (h == 0 ? first[h] != 0 : first[h] <= first[h - 1]) return false;
        if (first[h] >= bins) return false;
    }
    return true;
}

}  // namespace

void bind_evidence(nb::module_& m) {
    m.def(
        "gather_views",
        [](View<const i64, 4> cells, View<const i64> room, View<const i64> patch_cells, View<const i64> room_cells,
           i64 bin_steps) {
            require(cells.shape[2] == 2 && cells.shape[3] == room.size() && patch_cells.size() == room.size(),
                    "cells must be (bins, robots, 2, patches), and of each patch its room and its cells");
            require(numbers_all(room, room_cells.size()), "rooms of patches must ascend, and leave none out");
            require(bin_steps > 0 && all_in_range(room_cells, 1, INT64_MAX), "steps and rooms must not be empty");
            const auto whole = Array<i64, 4>::copy_of(cells);  // in one piece
            nb::gil_scoped_release unlocked;
            Views views = gather_views(whole, {room, patch_cells, room_cells}, bin_steps);
            return std::make_tuple(std::move(views.room_watched), std::move(views.patch_watched),
                                   std::move(views.shown), std::move(views.shown_parts));
        },
        "cells"_a, "room"_a, "patch_cells"_a, "room_cells"_a, "bin_steps"_a,
        R"(Return how much was in view, bin by bin; of several robots, that of the one that saw most.

Args:
    cells: int64 (bins, robots, 2, patches), cells in view, summed over the steps of a bin, and at most at one.
    room: int64 (patches,), the room of each patch, ascending, none left out.
    patch_cells: int64 (patches,), how many cells each has.
    room_cells: int64 (rooms,), how many cells each room has, 1 at least.
    bin_steps: Steps of a bin.

Returns:
    Shares of the cells in view, averaged over the steps: float64 (bins, rooms), and (bins, patches); at most at
    one step: float64 (bins, patches); and that in parts of 255: uint8 (bins, patches).)");
    m.def(
        "sum_places",
        [](View<const f64, 3> chains, View<const bool, 2> unknown, i64 users, View<const i64> first) {
            require(chains.shape[0] == std::max(users, i64{1}) && chains.shape[2] > 0,
                    "chains must be (users, bins, places), of one person if there are no users");
            require(unknown.shape[0] == chains.shape[1] && unknown.shape[1] == chains.shape[2] - 1,
                    "unknown must be (bins, places - 1)");
            require(begins(first, chains.shape[1]), "first must ascend from 0, below the number of bins");
            return sum_places(chains, unknown, users, first);
        },
        "chains"_a, "unknown"_a, "users"_a, "first"_a, Unlocked(),
        R"(Sum what presence adds up, by hour, in the order of NumPy's add.reduceat over the first axis.

Args:
    chains: float64 (users, bins, places), probability of each place, away last.
    unknown: bool (bins, places - 1), where somebody was perceived who is no user.
    users: How many users there are; 0: `chains` holds one person, who is anyone.
    first: int64 (hours,), the bins at which hours begin, the first 0.

Returns:
    float64 (hours, users + 1, 2 places + 1), anyone last: sums of the probability p of each place, of p (1 - p),
    and of 1.)");
}

}  // namespace fleet2d
