// Routes as Python holds them.
#pragma once

#include <vector>

#include "../detours.hpp"
#include "mesh.hpp"

namespace fleet2d {

// A route graph that owns its arrays, holds on to its mesh, and knows the routes found last. Threads may share it.
class Routes {
public:
    // Raises ValueError: the corners aren't what `Corners` says.
    Routes(nb::handle_t<OwnedMesh> mesh, const Corners& corners);

    // The points of the shortest path; none where there is none, or an end isn't strictly inside the space.
    std::vector<Point> find(Point start, Point goal) { return known_.find(mesh_, graph_, start, goal); }

    // The same round discs, without what was found before.
    std::vector<Point> around(Point start, Point goal, const std::vector<Disc>& discs) const;

    nb::object owner() const { return owner_; }
    const RouteGraph& graph() const { return graph_; }

private:
    nb::object owner_;  // of the arrays of mesh_
    Mesh mesh_;
    RouteGraph graph_;
    KnownRoutes known_;
};

// Discs of rows (n, 3): x, y and the distance to keep. Raises ValueError: the rows are none of discs near homes.
std::vector<Disc> discs_of(View<const i64, 2> rows);

}  // namespace fleet2d
