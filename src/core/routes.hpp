// Shortest paths among walls: A* over the corners at which a shortest path can bend.
//
// A shortest path in a polygonal space bends only at its reflex corners (Lozano-Pérez and Wesley,
// Communications of the ACM 22, 1979). The space is the free space shrunk by a body's radius, so a
// path may touch its border. Which corners see each other is decided in integers; lengths are the only
// floats (sums of correctly rounded square roots, the same on every machine).
#pragma once

#include <mutex>
#include <vector>

#include "mesh.hpp"

namespace fleet2d {

// The reflex corners of a space: the nodes of its route graph.
struct Corners {
    View<const i64> vertex;     // (nodes,) the vertex of the mesh at each, ascending
    View<const i64, 2> before;  // (nodes, 2) the vertex of the border before the corner [lattice units]
    View<const i64, 2> after;   // (nodes, 2) and the one after it
    View<const bool> simple;    // (nodes,) false where several walls meet: `before` and `after` say nothing
};

// Corners and the straight legs between them that a taut string can take. It owns its arrays.
struct RouteGraph {
    Array<i64> vertex;  // the corners, as in `Corners`
    Array<i64, 2> before;
    Array<i64, 2> after;
    Array<bool> simple;
    Array<i32> node_of_vertex;  // (vertices,), -1 = no corner
    Array<i32> leg_start;       // (nodes + 1,) where the legs from each corner begin
    Array<i32> leg_end;         // (legs,) the corner that each leads to, ascending for each corner
    Array<f64> leg_length;      // (legs,) [lattice units]

    Corners corners() const { return {vertex, before, after, simple}; }
};

// Connect all corners of a space that see each other along a taut leg.
RouteGraph build_route_graph(const Mesh& mesh, const Corners& corners);

// The points of the shortest path from `start` to `goal`; empty where there is none, or an end lies
// outside the space. Both ends are strictly inside: a goal on the border is not seen by the last corner.
// Ties go to the lower node: nodes are sorted by position, so the path depends on the walls only.
std::vector<Point> find_route(const Mesh& mesh, const RouteGraph& graph, Point start, Point goal);

// The corners that a taut string from a point can reach, in no particular order; none from outside the space.
std::vector<i64> corners_seen_from(const Mesh& mesh, const RouteGraph& graph, Point at);

// Points as rows, (points, 2).
inline View<const i64, 2> rows_of(const std::vector<Point>& points) {
    const i64* first = points.empty() ? nullptr : &points.front().x;
    return {first, {static_cast<i64>(points.size()), 2}};
}

// The routes that were found last: bodies go the same ways day after day. Threads may share it.
//
// Of many people, the ways of one push those of another out of the processor's caches, so it is a table of few bytes.
class KnownRoutes {
public:
    // As `find_route`; empty where there is none, or an end isn't strictly inside.
    std::vector<Point> find(const Mesh& mesh, const RouteGraph& graph, Point start, Point goal);

private:
    static constexpr std::size_t MOST = 1 << 17;  // then it begins anew
    struct Small {
        i32 x, y;
        bool operator==(const Small&) const = default;
    };
    struct Slot {
        Small start, goal;
        u32 begin, count;  // of its points; a slot without points is free
    };

    // The slot of a route, or the free one where it belongs.
    Slot& slot_of(Small start, Small goal);
    void put(Small start, Small goal, const std::vector<Point>& route);

    std::mutex mutex_;
    std::size_t size_ = 0;
    std::vector<Slot> slots_{16};  // a power of two, at most half of them taken
    std::vector<Small> points_;
};

}  // namespace fleet2d
