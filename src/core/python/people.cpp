#include "../people.hpp"

#include "stays.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<PeopleModel> = 6;

template <>
inline constexpr std::size_t border::members_of<DayEvidence> = 7;

template <>
inline constexpr std::size_t border::members_of<PeopleMoments> = 5;

template <>
inline constexpr std::size_t border::members_of<KnownMoments> = 5;

namespace {

void check_people(const PeopleModel& model) {
    const i64 people = model.size();
    require(
        people > 0 && model.follow.size() == people && model.spread.size() == people && model.restless.size() == people,
        "there must be people, and all arrays of a model must be of as many");
    check_model(model.of(0));
}

void check_day(const DayEvidence& day, const PeopleModel& model, i64 longest) {
    const i64 bins = day.view.size(), patches = model.spread.shape[1], sightings = day.bin.size();
    require(bins > 0 && day.minute.size() == bins && longest > 0, "minute and view must be (bins,), not empty");
    require(day.views.shape[1] == patches && all_in_range(day.view, 0, day.views.size()),
            "views must be (views, patches), and view hold numbers of views");
    require(day.user.size() == sightings && day.patch.size() == sightings && day.steps.size() == sightings,
            "user, bin, patch and steps must have one length");
    require(std::is_sorted(day.user.begin(), day.user.end()), "user must ascend");
    require(all_in_range(day.patch, 0, patches) && all_in_range(day.bin, 0, bins),
            "bin must hold numbers of bins, patch numbers of patches");
    for (i64 person = 0; person < model.size(); ++person) {
        const auto [begin, end] = day.sightings_of(person);
        require(std::is_sorted(day.bin.begin() + begin, day.bin.begin() + end),
                "the bins of a person's sightings must ascend");
    }
}

auto places_of(PeoplePlaces&& where) {
    return std::tuple(std::move(where.places), std::move(where.bins), std::move(where.begin));
}

}  // namespace

void bind_people(nb::module_& m) {
    m.def(
        "follow_people",
        [](const PeopleModel& model, const DayEvidence& day, i64 longest, View<f64, 3> now) {
            check_people(model);
            check_day(day, model, longest);
            require(now.shape == std::array{model.size(), model.of(0).stages(), model.spread.shape[1]},
                    "now must be (people, stages, patches)");
            return places_of(follow_people(model, day, longest, now));
        },
        "model"_a, "day"_a, "longest"_a, "now"_a, Unlocked(),
        R"(Return `follow` of each person, from merged bins of a day, when no view is known before.

Args:
    model: The transition probabilities: as of one person, with people as the first dimension.
    day: The evidence.
    longest: Largest number of bins in a stretch.
    now: float64 (people, stages, patches), probability before the first bin; becomes that after the last.

Returns:
    P(room), away last, in all stretches of one person after the other: float64 (stretches, rooms + 1); the number
    of bins of each, int64 (stretches,); and where those of each person begin, int64 (people + 1,).

Raises:
    ValueError: Arrays aren't of the same people, rooms and patches, or hold numbers of patches or bins that aren't.)");
    m.def(
        "learned_stays",
        [](const KnownMoments& moments, View<const f64> length, View<const f64> spread, View<const f64> possible,
           View<const i64> first, f64 restless) {
            const i64 people = moments.time.size(), rooms = possible.size(), patches = spread.size();
            require(rooms > 0 && length.size() > 0 && first.size() == rooms + 1 && first[0] == 0 &&
                        first[rooms] == patches && std::is_sorted(first.begin(), first.end()),
                    "there must be rooms and stages, and first must ascend from 0 to the number of patches");
            const i64 nodes = rooms * length.size();
            require(moments.time.shape == std::array{people, nodes} &&
                        moments.exits.shape == std::array{people, nodes, rooms + 1} &&
                        moments.arrivals.shape == std::array{people, patches} &&
                        moments.moves.shape == std::array{people, rooms} &&
                        moments.rests.shape == std::array{people, rooms},
                    "moments must be of people, and of the stages, rooms and patches of the others");
            LearnedStays learned = learned_stays(moments, {length, spread, possible, first, restless});
            return std::tuple(std::move(learned.stay), std::move(learned.follow), std::move(learned.spread),
                              std::move(learned.restless));
        },
        "moments"_a, "length"_a, "spread"_a, "possible"_a, "first"_a, "restless"_a, Unlocked(),
        R"(Return the most probable transitions of people: expected counts by expected time, with a prior.

Args:
    moments: What was learned, with people as the first dimension.
    length: float64 (stages,), mean length of each stage of a stay before anything is learned [bins].
    spread: float64 (patches,), the share of each patch in its room.
    possible: float64 (rooms + 1,), 1 for the places where people may be, away last, 0 for the others.
    first: int64 (rooms + 2,), as of `StayModel`.
    restless: Probability per bin of changing patch before anything is learned.

Returns:
    The fields of `StayModel` before `first`, with people as the first dimension.

Raises:
    ValueError: Arrays aren't of the same people, stages, rooms and patches.)");
    m.def(
        "smooth_people",
        [](const PeopleModel& model, const DayEvidence& day, i64 longest, View<const f64, 3> prior,
           View<const f64, 3> future, const PeopleMoments& moments) {
            check_people(model);
            check_day(day, model, longest);
            const StayModel one = model.of(0);
            const i64 people = model.size(), nodes = one.nodes(), rooms = one.rooms(), patches = one.patches();
            const std::array states{people, one.stages(), patches};
            require(prior.shape == states && future.shape == states,
                    "prior and future must be (people, stages, patches)");
            require(moments.time.shape == std::array{people, nodes} && moments.exits.shape == model.follow.shape &&
                        moments.arrivals.shape == std::array{people, patches} &&
                        moments.moves.shape == std::array{people, rooms} &&
                        moments.rests.shape == std::array{people, rooms},
                    "moments must be of the people, rooms, stages and patches of model");
            PeopleSmoothed result = smooth_people(model, day, longest, prior, future, moments);
            return std::tuple(places_of(std::move(result.where)), std::move(result.end), std::move(result.ahead));
        },
        "model"_a, "day"_a, "longest"_a, "prior"_a, "future"_a, "moments"_a, Unlocked(),
        R"(Return `smooth` of each person, from merged bins of a day.

Args:
    model: The transition probabilities: as of one person, with people as the first dimension.
    day: The evidence.
    longest: Largest number of bins in a stretch.
    prior: float64 (people, stages, patches), probability before the first bin.
    future: float64 (people, stages, patches), likelihood of the evidence after the last one.
    moments: To add to; with people as the first dimension.

Returns:
    What `follow_people` returns, given all evidence; the probability of stage and patch after the last bin, given
    what was before, and how likely each before the first makes the evidence, largest 1: float64 (people, stages,
    patches) each.

Raises:
    ValueError: Arrays aren't of the same people, rooms and patches, or hold numbers of patches or bins that aren't.)");
}

}  // namespace fleet2d
