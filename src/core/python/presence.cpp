#include "../presence.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_presence(nb::module_& m) {
    m.def(
        "advance",
        [](View<const f64> probability, View<const f64, 2> transition, i64 bins) {
            require(transition.shape[0] == probability.size() && transition.shape[1] == probability.size(),
                    "transition must be (states, states)");
            return advance(probability, transition, bins);
        },
        "probability"_a, "transition"_a, "bins"_a, Unlocked(),
        R"(Return the state probabilities of a chain `bins` bins later, without evidence.

Args:
    probability: float64 (states,), the present probabilities.
    transition: float64 (states, states), from row to column within a bin.
    bins: How many bins.

Returns:
    float64 (states,).)");
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
        "resampled",
        [](u64 key, View<const f64, 2> days, i64 replicates) {
            require(days.size() < (i64{1} << 31), "days must be fewer than 2**31");
            require(replicates >= 0, "replicates must be 0 or more");
            return resampled(key, days, replicates);
        },
        nb::sig("def resampled(key: int | numpy.uint64, days: numpy.typing.NDArray[numpy.float64], replicates: int) -> "
                "numpy.typing.NDArray[numpy.float64]"),
        "key"_a, "days"_a, "replicates"_a, Unlocked(), R"(Sum days drawn with replacement.

Args:
    key: Of the stream of draws.
    days: float64 (days, values).
    replicates: How many sums.

Returns:
    float64 (replicates, values), each the sum of as many days as there are.)");
}

}  // namespace fleet2d
