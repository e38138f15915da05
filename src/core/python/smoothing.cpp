#include "../smoothing.hpp"

#include "stays.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
struct border::Fields<Moments> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members =
        std::tuple(&Moments::time, &Moments::exits, &Moments::arrivals, &Moments::moves, &Moments::rests);
};

void bind_smoothing(nb::module_& m) {
    m.def(
        "smooth",
        [](const Ways& ways, const Stretches& stretches, View<const f64, 2> dawn, View<const f64, 2> dusk,
           const Moments& moments) {
            check_stays(ways, stretches);
            const std::array states{ways.stages(), ways.patches()};
            require(dawn.shape == states && dusk.shape == states, "dawn and dusk must be (stages, patches)");
            require(moments.time.size() == ways.nodes() && moments.exits.shape == ways.follow.shape &&
                        moments.arrivals.size() == ways.patches() && moments.moves.size() == ways.rooms() &&
                        moments.rests.size() == ways.rooms(),
                    "moments must be of the rooms, stages and patches of ways");
            Smoothed made = smooth(ways, stretches, dawn, dusk, moments);
            return std::tuple(std::move(made.places), std::move(made.end), std::move(made.ahead));
        },
        "ways"_a, "stretches"_a, "dawn"_a, "dusk"_a, "moments"_a, Unlocked(),
        R"(Return where a person was, given all evidence of some stretches.

Between two stretches a person may go on once: leave a stage, with the chance to do so within the
later one, or change patch within the room. With stretches of one bin that is a hidden Markov chain;
with longer ones, what happens within a stretch is taken to happen as it begins. A person who comes
to a patch of which a part is in view is in that part with the chance of its size, and stays in it
or out of it until the person moves or what is in view of it changes. In view the person isn't
perceived in any of n bins with (1 - detection)^n; out of view never, unless nothing of the patch
was in view where somebody was perceived: positions may be noisy.

Args:
    ways: How the person goes on.
    stretches: The evidence.
    dawn: float64 (stages, patches), probability before the first stretch.
    dusk: float64 (stages, patches), how likely each makes what comes after the last.
    moments: To add to.

Returns:
    P(room) in each stretch, float64 (stretches, rooms + 1); the probability of stage and patch
    after the last, given what was before, and how likely each before the first makes the
    evidence, largest 1: float64 (stages, patches) each.

Raises:
    ValueError: Arrays aren't of one person, or hold numbers of patches or sightings that aren't.)");
}

}  // namespace fleet2d
