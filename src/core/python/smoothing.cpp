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
    m.def("smooth",
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
          "ways"_a, "stretches"_a, "dawn"_a, "dusk"_a, "moments"_a, Unlocked());
}

}  // namespace fleet2d
