#include "../flows.hpp"

#include <cmath>

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

bool all_finite(View<const f64, 2> numbers) {
    for (i64 i = 0; i < numbers.size(); ++i) {
        const View<const f64> row = numbers[i];
        if (!std::all_of(row.begin(), row.end(), [](f64 number) { return std::isfinite(number); })) return false;
    }
    return true;
}

Array<f64> checked_earth_mover(View<const f64, 2> from, View<const f64, 2> to, View<const f64, 2> metres) {
    require(from.shape == to.shape, "both must be (n, places)");
    require(metres.shape == std::array{from.shape[1], from.shape[1]}, "metres must be (places, places)");
    require(all_finite(from) && all_finite(to) && all_finite(metres), "all numbers must be finite");
    return earth_mover(from, to, metres);
}

}  // namespace

void bind_flows(nb::module_& m) {
    m.def("earth_mover", &checked_earth_mover, "start"_a, "end"_a, "metres"_a, Unlocked(),
          R"(Return the least mean distance by which each of some distributions is moved onto another one.

The minimum of the sum of f(i, j) * metres(i, j) over flows f >= 0 from place to place, found exactly
by successive shortest paths. Mass that both have at a place stays.

Args:
    start: float64 (n, places).
    end: float64 (n, places), each of the sum of that row of `start`.
    metres: float64 (places, places), at least 0.

Returns:
    float64 (n,).)");
}

}  // namespace fleet2d
