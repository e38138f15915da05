// Bodies that give way, as they come from Python.
#pragma once

#include "../giving_way.hpp"
#include "routes.hpp"

namespace fleet2d {

// Row, space, routes or None, speed, turn rate, beat, and a function that leads where the routes don't: see `Yielder`
// of `fleet2d.entities.yielder`.
using YielderFields = std::tuple<i64, Mesh, nb::object, f64, f64, i64, nb::callable>;

// The other body, near, distance, the rooms of places, the parts of the triangles of the space or a function of x and y
// that returns the part of a point, and the part of the body: see `BodyInWay` there.
using BodyInWayFields = std::tuple<i64, i64, i64, View<const i16, 2>, nb::object, i64>;

// The parts of cells, the part of the body, a function that returns where to begin, how many cells to look nearby and
// how far, at every so many of them, for how many places, and how near others may come: see `AsideSearch` there.
using AsideSearchFields = std::tuple<View<const i32, 2>, i64, nb::callable, i64, i64, i64, i64, View<const i64>>;

// Discs as rows (n, 3): x, y and the distance to keep.
Array<i64, 2> rows_of(const std::vector<Disc>& discs);

// The body of a call: its fields outlive it.
Yielder yielder_of(const YielderFields& fields);

// How it passes another one in its space; all fields outlive it.
BodyInWay body_in_way_of(const BodyInWayFields& fields, const Mesh& space);

// Where it looks for places.
AsideSearch aside_search_of(const AsideSearchFields& fields);

// Points as rows (n, 2), and back.
std::vector<Point> points_of(View<const i64, 2> rows);

}  // namespace fleet2d
