#include "routes.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>

#include "../lattice.hpp"
#include "line_of_sight.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<Corners> = 4;

Routes::Routes(nb::handle_t<OwnedMesh> mesh, const Corners& corners)
    : owner_(nb::borrow(mesh)), mesh_(nb::cast<const OwnedMesh&>(mesh).mesh()) {
    const i64 nodes = corners.vertex.size();
    require(corners.before.shape == std::array{nodes, i64{2}} && corners.after.shape == corners.before.shape &&
                corners.simple.size() == nodes,
            "vertex and simple must be (nodes,), before and after (nodes, 2)");
    require(all_in_range(corners.vertex, 0, mesh_.vertex_count()), "vertex must hold numbers of vertices");
    require(all_in_range(corners.before, 0, LIMIT + 1) && all_in_range(corners.after, 0, LIMIT + 1),
            "before and after must be in 0 to 2**20");
    for (i64 node = 1; node < nodes; ++node) {
        require(corners.vertex[node - 1] < corners.vertex[node], "vertex must ascend");
    }
    graph_ = build_route_graph(mesh_, corners);
}

std::vector<Point> Routes::around(Point start, Point goal, const std::vector<Disc>& discs) const {
    if (!strictly_inside(mesh_, start.x, start.y) || !strictly_inside(mesh_, goal.x, goal.y)) return {};
    return find_detour(mesh_, graph_, start, goal, discs);
}

std::vector<Disc> discs_of(View<const i64, 2> rows) {
    require(rows.shape[1] == 3, "discs must be (n, 3)");
    std::vector<Disc> discs;
    for (i64 i = 0; i < rows.size(); ++i) {
        check_point(rows(i, 0), rows(i, 1));
        require(0 <= rows(i, 2) && rows(i, 2) <= LIMIT, "the distance to a disc must be in 0 to 2**20");
        discs.push_back({{rows(i, 0), rows(i, 1)}, rows(i, 2)});
    }
    return discs;
}

namespace {

// What `__getstate__` returns, and `__init__` takes: the mesh and the corners.
auto state_of(nb::handle_t<Routes> self) {
    const Routes& routes = nb::cast<const Routes&>(self);
    const auto [vertex, before, after, simple] = routes.graph().corners();
    return nb::make_tuple(routes.owner(),
                          nb::make_tuple(border::borrowed(vertex, self), border::borrowed(before, self),
                                         border::borrowed(after, self), border::borrowed(simple, self)));
}

std::optional<Array<i64, 2>> find(Routes& self, i64 ax, i64 ay, i64 bx, i64 by) {
    const auto points = self.find({ax, ay}, {bx, by});
    if (points.empty()) return std::nullopt;
    return Array<i64, 2>::copy_of(rows_of(points));
}

std::optional<Array<i64, 2>> around(Routes& self, i64 ax, i64 ay, i64 bx, i64 by, View<const i64, 2> discs) {
    const auto points = self.around({ax, ay}, {bx, by}, discs_of(discs));
    if (points.empty()) return std::nullopt;
    return Array<i64, 2>::copy_of(rows_of(points));
}

template <auto Member>
auto array_of_graph() {
    return [](nb::handle_t<Routes> self) {
        return border::borrowed((nb::cast<const Routes&>(self).graph().*Member).view(), self);
    };
}

}  // namespace

void bind_routes(nb::module_& m) {
    nb::class_<Routes>(m, "Routes", R"(Shortest paths in a space: its corners, and the straight legs between them.

Args:
    mesh: The space.
    corners: Corners, its reflex corners.

Raises:
    ValueError: The corners have another shape, or are none of the mesh.)")
        .def(nb::init<nb::handle_t<OwnedMesh>, const Corners&>(), "mesh"_a, "corners"_a)
        .def("find", &find, "ax"_a, "ay"_a, "bx"_a, "by"_a, Unlocked(),
             R"(Return the shortest path from (ax, ay) to (bx, by), int64 (n, 2).

Ties go to the corner that is lower by (x, y), so the path depends on the walls only.

Returns:
    None where there is no way, or an end isn't strictly inside the space.)")
        .def("around", &around, "ax"_a, "ay"_a, "bx"_a, "by"_a, "discs"_a, Unlocked(),
             R"(Return the shortest path from (ax, ay) to (bx, by) round some discs, int64 (n, 2).

It bends at corners of the space, and at those of octagons around the discs. From a start within a disc it leads away.

Args:
    ax: Position of its begin [lattice units].
    ay: Position of its begin [lattice units].
    bx: Position of its end [lattice units].
    by: Position of its end [lattice units].
    discs: x and y of the middle of each, and a distance that the path stays above [lattice units], int64 (n, 3).

Returns:
    None where there is no way, or an end isn't strictly inside the space.)")
        .def_prop_ro("leg_start", array_of_graph<&RouteGraph::leg_start>(),
                     "int32 (corners + 1,), where the legs from each corner begin in `leg_end`.")
        .def_prop_ro("leg_end", array_of_graph<&RouteGraph::leg_end>(), "int32 (legs,), the corner that each leads to.")
        .def_prop_ro("leg_length", array_of_graph<&RouteGraph::leg_length>(), "float64 (legs,) [lattice units].")
        .def("__getstate__", &state_of, nb::sig("def __getstate__(self) -> tuple[typing.Any, ...]"))
        .def("__setstate__", [](Routes& self, std::tuple<nb::handle_t<OwnedMesh>, Corners> state) {
            new (&self) Routes(std::get<0>(state), std::get<1>(state));
        });

    m.def(
        "place_beside",
        [](View<const i32, 2> part_of_cell, i64 part, View<const i16, 2> room_of_cell, i64 room,
           std::pair<i64, i64> place, std::pair<i64, i64> from, i64 slack,
           View<const i64, 2> discs) -> std::optional<std::pair<i64, i64>> {
            require(part_of_cell.shape == room_of_cell.shape, "the parts and rooms must be of the same cells");
            check_point(place.first, place.second);
            check_point(from.first, from.second);
            require(is_inside(part_of_cell.shape, {floor_div(place.second, SUB), floor_div(place.first, SUB)}),
                    "place must be in a cell");
            require(0 <= slack && slack <= LIMIT, "slack must be in 0 to 2**20");
            const Floor floor{part_of_cell, part, room_of_cell, room};
            const auto found =
                place_beside(floor, {place.first, place.second}, {from.first, from.second}, slack, discs_of(discs));
            return found ? std::optional(std::pair(found->x, found->y)) : std::nullopt;
        },
        "part_of_cell"_a, "part"_a, "room_of_cell"_a, "room"_a, "place"_a, "start"_a, "slack"_a, "discs"_a,
        R"(Return the centre of the clear cell nearest to a place.

Of several that are about as near, it is the one nearest to where the body comes from.

Args:
    part_of_cell: int32 (rows, columns), the part of its space of each cell.
    part: The part in which the cell must be.
    room_of_cell: int16 (rows, columns), the room of each cell.
    room: The room in which the cell must be; below 0: any.
    place: The place [lattice units].
    start: Where the body comes from [lattice units].
    slack: By how much other cells may be farther from the place than the nearest one [lattice units].
    discs: As for `Routes.around`.

Returns:
    (x, y) [lattice units]; None where no cell is clear.)");
    m.def("distance", nb::overload_cast<i64, i64, i64, i64>(&distance), "ax"_a, "ay"_a, "bx"_a, "by"_a,
          "Return the distance of two lattice points [lattice units].");
}

}  // namespace fleet2d
