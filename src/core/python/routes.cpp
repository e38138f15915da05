#include "routes.hpp"

#include <nanobind/stl/optional.h>

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
        .def_prop_ro("leg_start", array_of_graph<&RouteGraph::leg_start>(),
                     "int32 (corners + 1,), where the legs from each corner begin in `leg_end`.")
        .def_prop_ro("leg_end", array_of_graph<&RouteGraph::leg_end>(), "int32 (legs,), the corner that each leads to.")
        .def_prop_ro("leg_length", array_of_graph<&RouteGraph::leg_length>(), "float64 (legs,) [lattice units].")
        .def("__getstate__", &state_of, nb::sig("def __getstate__(self) -> tuple[typing.Any, ...]"))
        .def("__setstate__", [](Routes& self, std::tuple<nb::handle_t<OwnedMesh>, Corners> state) {
            new (&self) Routes(std::get<0>(state), std::get<1>(state));
        });

    m.def("distance", nb::overload_cast<i64, i64, i64, i64>(&distance), "ax"_a, "ay"_a, "bx"_a, "by"_a,
          "Return the distance of two lattice points [lattice units].");
}

}  // namespace fleet2d
