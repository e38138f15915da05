// The cheapest way to move one distribution onto another.
#pragma once

#include "array.hpp"

namespace fleet2d {

// Mass below which nothing is moved.
inline constexpr f64 NO_MASS = 1e-12;

// For each pair of distributions over places, (n, places), the least mean distance by which `from` is moved onto
// `to`: the minimum of the sum of f(i, j) * metres(i, j) over flows f >= 0 from place to place. Mass that both have at
// a place stays. `metres` is (places, places), at least 0.
Array<f64> earth_mover(View<const f64, 2> from, View<const f64, 2> to, View<const f64, 2> metres);

}  // namespace fleet2d
