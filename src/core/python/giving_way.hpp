// Bodies that give way, as they come from Python.
#pragma once

#include "../giving_way.hpp"
#include "routes.hpp"

namespace fleet2d {

// Row, space, routes or None, speed, turn rate, beat, and a function that leads where the routes don't: see `Yielder`
// of `fleet2d.kernels`.
using YielderFields = std::tuple<i64, Mesh, nb::object, f64, f64, i64, nb::callable>;

// Discs as rows (n, 3): x, y and the distance to keep.
Array<i64, 2> rows_of(const std::vector<Disc>& discs);

// The body of a call: its fields outlive it.
Yielder yielder_of(const YielderFields& fields);

}  // namespace fleet2d
