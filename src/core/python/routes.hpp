// Routes as Python holds them.
#pragma once

#include <vector>

#include "../routes.hpp"
#include "mesh.hpp"

namespace fleet2d {

// A route graph that owns its arrays, holds on to its mesh, and knows the routes found last. Threads may share it.
class Routes {
public:
    // Raises ValueError: the corners aren't what `Corners` says.
    Routes(nb::handle_t<OwnedMesh> mesh, const Corners& corners);

    // The points of the shortest path; none where there is none, or an end isn't strictly inside the space.
    std::vector<Point> find(Point start, Point goal) { return known_.find(mesh_, graph_, start, goal); }

    nb::object owner() const { return owner_; }
    const RouteGraph& graph() const { return graph_; }

private:
    nb::object owner_;  // of the arrays of mesh_
    Mesh mesh_;
    RouteGraph graph_;
    KnownRoutes known_;
};

}  // namespace fleet2d
