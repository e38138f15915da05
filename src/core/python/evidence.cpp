#include "../evidence.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

// Where people were, one after the other; as in PeoplePlaces.
struct Chains {
    View<const f64, 2> places;
    View<const i64> bins;
    View<const i64> begin;
};

template <>
inline constexpr std::size_t border::members_of<Chains> = 3;

namespace {

// Whether a chain is of so many places and bins.
bool is_chain(const Chain& chain, i64 places, i64 bins) {
    if (chain.places.size() != chain.bins.size() || chain.places.shape[1] != places) return false;
    if (!all_in_range(chain.bins, 1, i64{1} << 31)) return false;
    i64 sum = 0;
    for (const i64 length : chain.bins) sum += length;
    return sum == bins;
}

// The chain of each person.
std::vector<Chain> split(const Chains& chains) {
    const i64 count = chains.bins.size(), width = chains.places.shape[1];
    require(chains.places.size() == count && all_in_range(chains.begin, 0, count + 1) &&
                std::is_sorted(chains.begin.begin(), chains.begin.end()),
            "chains must be (stretches, places), (stretches,), and where those of each person begin");
    std::vector<Chain> result;
    for (i64 person = 0; person + 1 < chains.begin.size(); ++person) {
        const i64 begin = chains.begin[person], end = chains.begin[person + 1];
        const View<const f64, 2> places(chains.places.data + begin * chains.places.stride[0], {end - begin, width},
                                        chains.places.stride);
        result.push_back({places, chains.bins.slice(begin, end)});
    }
    return result;
}

// Whether numbers ascend from 0, by one at most, to `count` - 1.
bool numbers_all(View<const i64> rooms, i64 count) {
    i64 next = 0;
    for (const i64 room : rooms) {
        if (room != next && room != next - 1) return false;
        if (room == next) ++next;
    }
    return next == count;
}

// Whether the numbers (robots, 2, patches) of each bin lie one after the other.
bool is_bin_whole(View<const i64, 4> cells) {
    const auto [bins, robots, two, patches] = cells.shape;
    return cells.stride[2] == patches && (robots <= 1 || cells.stride[1] == two * patches);
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
        "list_sightings",
        [](View<const i64> step, View<const i32> index, View<const i64> user, View<const i64> room, i64 bin_steps,
           i64 bins, i64 users, i64 rooms) {
            require(step.size() == index.size(), "step and index must have one length");
            require(user.size() == room.size(), "user and room must have one length");
            require(all_in_range(index, 0, user.size()), "index must be that of a user and a room");
            require(bin_steps > 0, "bin_steps must be 1 or more");
            const auto is_size = [](i64 number) { return 0 <= number && number < (i64{1} << 31); };
            require(is_size(bins) && is_size(users) && is_size(rooms) && users * rooms < (i64{1} << 31),
                    "bins, users and rooms must be 0 or more, users times rooms below 2**31");
            require(users > 0 && all_in_range(user, INT64_MIN, users) && all_in_range(room, INT64_MIN, rooms),
                    "users must count each user, and one more for anybody, rooms each room");
            SightingCounts made = list_sightings(step, index, user, room, bin_steps, {bins, users, rooms});
            return std::tuple(std::move(made.user), std::move(made.bin), std::move(made.room), std::move(made.steps));
        },
        "step"_a, "index"_a, "user"_a, "room"_a, "bin_steps"_a, "bins"_a, "users"_a, "rooms"_a, Unlocked(),
        R"(Count the steps at which each user was perceived in each room, each step once, where that isn't 0.

Args:
    step: int64 (n,), in order of time, from the beginning of the first bin.
    index: int32 (n,), the number of each sighting among the distinct ones.
    user: int64 (k,), of each distinct one, below 0 for somebody unknown.
    room: int64 (k,), likewise, below 0 for none.
    bin_steps: Steps of a bin.
    bins: How many bins there are.
    users: How many users there are, and one more for anybody.
    rooms: How many rooms there are.

Returns:
    User, bin, room, and number of steps, int64 (n,) each, in ascending order.)");
    m.def(
        "gather_views",
        [](View<const i64, 4> cells, View<const i64> room, View<const i64> patch_cells, View<const i64> room_cells,
           i64 bin_steps) {
            require(cells.shape[2] == 2 && cells.shape[3] == room.size() && patch_cells.size() == room.size(),
                    "cells must be (bins, robots, 2, patches), and of each patch its room and its cells");
            require(numbers_all(room, room_cells.size()), "rooms of patches must ascend, and leave none out");
            require(bin_steps > 0 && all_in_range(room_cells, 1, INT64_MAX), "steps and rooms must not be empty");
            nb::gil_scoped_release unlocked;
            Array<i64, 4> copy;
            if (!is_bin_whole(cells)) copy = Array<i64, 4>::copy_of(cells);
            Views views = gather_views(is_bin_whole(cells) ? cells : copy, {room, patch_cells, room_cells}, bin_steps);
            return std::make_tuple(std::move(views.room_watched), std::move(views.patch_watched),
                                   std::move(views.shown), std::move(views.shown_parts));
        },
        "cells"_a, "room"_a, "patch_cells"_a, "room_cells"_a, "bin_steps"_a,
        R"(Return how much was in view in each bin; of several robots, the one that saw most counts.

Args:
    cells: int64 (bins, robots, 2, patches), cells in view: the sum over the steps of a bin, and the maximum.
    room: int64 (patches,), the room of each patch, ascending, none left out.
    patch_cells: int64 (patches,), number of cells of each.
    room_cells: int64 (rooms,), number of cells of each room, at least 1.
    bin_steps: Steps of a bin.

Returns:
    Shares of the cells in view, averaged over the steps: float64 (bins, rooms), and (bins, patches); at most at
    one step: float64 (bins, patches); and that in parts of 255: uint8 (bins, patches).)");
    m.def(
        "watched_views",
        [](View<const u8, 2> shown, View<const i64> user, View<const i64> bin, View<const i64> patch,
           View<const i64> steps, i64 users) {
            const i64 count = user.size();
            require(bin.size() == count && patch.size() == count && steps.size() == count,
                    "user, bin, patch and steps must have one length");
            require(all_in_range(bin, 0, shown.size()) && all_in_range(patch, 0, shown.shape[1]),
                    "bin and patch must be those of `shown`");
            require(all_in_range(steps, 0, i64{1} << 31), "steps must be 0 or more, and below 2**31");
            WatchedViews watched = watched_views(shown, {user, bin, patch, steps}, users);
            return std::make_tuple(std::move(watched.view), std::move(watched.views));
        },
        "shown"_a, "user"_a, "bin"_a, "patch"_a, "steps"_a, "users"_a, Unlocked(),
        R"(Return what was in view but for patches with an unknown person, who may be any user.

An unknown person was where anybody was perceived in more steps than all users together; nowhere with one user.

Args:
    shown: uint8 (bins, patches), the part of each patch in view.
    user: int64 (n,), who was perceived; the last of `users` is anybody.
    bin: int64 (n,).
    patch: int64 (n,).
    steps: int64 (n,), in how many steps.
    users: How many users there are, and one more for anybody.

Returns:
    The number of the view in each bin, int64 (bins,), and the views, each other than the one before: uint8 (views,
    patches + 1), the last column 0.)");
    m.def(
        "sum_places",
        [](const Chains& chains, View<const bool, 2> unknown, i64 users, View<const i64> first) {
            const std::vector<Chain> all = split(chains);
            const i64 count = static_cast<i64>(all.size()), bins = unknown.size();
            require(count == std::max(users, i64{1}), "there must be a chain of each user, one if there are no users");
            for (const Chain& chain : all) {
                require(is_chain(chain, unknown.shape[1] + 1, bins),
                        "a chain must be probabilities (stretches, places), and how many bins each stretch has");
            }
            require(begins(first, bins), "first must ascend from 0, below the number of bins");
            return sum_places(all, unknown, users, first);
        },
        "chains"_a, "unknown"_a, "users"_a, "first"_a, Unlocked(),
        R"(Sum presence by hour, in the order of NumPy's add.reduceat over the first axis.

Args:
    chains: Consecutive stretches of bins, those of one user after the other: float64 (stretches, places),
        probability of each place, away last; int64 (stretches,), number of bins of each; and where those of each
        user begin, int64 (users + 1,).
    unknown: bool (bins, places - 1), the rooms with an unknown person.
    users: Number of users; 0: `chains` holds one person, who is anyone.
    first: int64 (hours,), the bins at which hours begin, the first 0.

Returns:
    float64 (hours, users + 1, 2 places + 1), anyone last: sums of the probability p of each place, of p (1 - p),
    and of 1.)");
}

}  // namespace fleet2d
