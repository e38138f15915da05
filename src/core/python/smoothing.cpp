#include "../smoothing.hpp"

#include "stays.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<Moments> = 5;

void bind_smoothing(nb::module_& m) {
    m.def(
        "smooth",
        [](const StayModel& model, const Stretches& stretches, View<const f64, 2> prior, View<const f64, 2> future,
           const Moments& moments) {
            check_stays(model, stretches);
            const std::array states{model.stages(), model.patches()};
            require(prior.shape == states && future.shape == states, "prior and future must be (stages, patches)");
            require(moments.time.size() == model.nodes() && moments.exits.shape == model.follow.shape &&
                        moments.arrivals.size() == model.patches() && moments.moves.size() == model.rooms() &&
                        moments.rests.size() == model.rooms(),
                    "moments must be of the rooms, stages and patches of model");
            Smoothed result = smooth(model, stretches, prior, future, moments);
            return std::tuple(std::move(result.places), std::move(result.end), std::move(result.ahead));
        },
        "model"_a, "stretches"_a, "prior"_a, "future"_a, "moments"_a, Unlocked(),
        R"(Return the distribution over rooms in each stretch, given all evidence.

Between two stretches a person may make one transition: leave a stage, with the probability of doing
so within the later stretch, or change patch within the room. With stretches of one bin that is a
hidden Markov chain; with longer ones, transitions within a stretch count as if they happened at its
begin. A person who comes to a patch is in its visible part with the probability of its size, and
stays in or out of view until the person moves or the view changes. A person in view is missed in
all of n bins with probability (1 - detection)^n; a person out of view is never perceived, unless
nothing of the patch is in view: positions may be noisy.

Args:
    model: The transition probabilities of the person.
    stretches: The evidence.
    prior: float64 (stages, patches), probability before the first stretch.
    future: float64 (stages, patches), likelihood of the evidence after the last one.
    moments: To add to.

Returns:
    P(room) in each stretch, float64 (stretches, rooms + 1); the probability of stage and patch
    after the last, given what was before, and how likely each before the first makes the
    evidence, largest 1: float64 (stages, patches) each.

Raises:
    ValueError: Arrays aren't of one person, or hold numbers of patches or sightings that aren't.)");
}

}  // namespace fleet2d
