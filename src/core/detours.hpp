// Detours: shortest ways among walls that keep clear of round bodies, which stand in the way.
//
// Each body is an octagon around what has to be kept clear, and a way bends at corners of the space and of octagons.
// Only bodies that are in the way count: of those that no way has hit so far, nothing is computed.
#pragma once

#include <optional>
#include <vector>

#include "grid.hpp"
#include "routes.hpp"

namespace fleet2d {

// A round body that stands, and the distance of the middles at which others pass it.
struct Disc {
    Point at;
    i64 reach;  // lattice units; ways stay farther away than that

    // Whether a point is far enough from it.
    bool is_clear_of(Point p) const { return squared_gap(at, p) > reach * reach; }
    // Whether all of a straight leg is.
    bool is_clear_of(Point a, Point b) const;
    // Whether a straight leg that begins too near leads away.
    bool is_left_by(Point a, Point b) const { return (b.x - a.x) * (a.x - at.x) + (b.y - a.y) * (a.y - at.y) >= 0; }

private:
    static i64 squared_gap(Point a, Point b) { return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y); }
};

// The points of the shortest way from `start` to `goal` that keeps clear of all discs, by the corners of their
// octagons; empty where there is none. Both ends are strictly inside the space. From a start that is too near to a
// disc, the way leads away from it.
std::vector<Point> find_detour(const Mesh& mesh, const RouteGraph& graph, Point start, Point goal,
                               const std::vector<Disc>& discs);

// The cells in which a body may stop beside a place.
struct Floor {
    View<const i32, 2> part_of_cell;
    i64 part;
    View<const i16, 2> room_of_cell;
    i64 room;  // below 0: any

    bool has(GridCell cell) const {
        return at(part_of_cell, cell) == part && (room < 0 || at(room_of_cell, cell) == room);
    }
};

// The centre of the cell nearest to a place that is clear of all discs; of several that are by `slack` lattice units
// farther away at most, the one nearest to `from`. Nothing where no cell is clear.
std::optional<Point> place_beside(const Floor& floor, Point place, Point from, i64 slack,
                                  const std::vector<Disc>& discs);

}  // namespace fleet2d
