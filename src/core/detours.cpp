#include "detours.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <queue>
#include <tuple>
#include <utility>

#include "lattice.hpp"
#include "line_of_sight.hpp"

namespace fleet2d {
namespace {

constexpr f64 UNREACHED = std::numeric_limits<f64>::infinity();

std::size_t index(i64 i) { return static_cast<std::size_t>(i); }

f64 length_of_leg(Point a, Point b) { return distance(a.x, a.y, b.x, b.y); }

// The corners of an octagon around a disc, whose sides are outside of it.
std::array<Point, 8> octagon_around(const Disc& disc) {
    const i64 far = disc.reach * 10824 / 10000 + 3, near = far * 7072 / 10000;  // 1 / cos(pi / 8); cos(pi / 4)
    const auto [x, y] = disc.at;
    return {{{x + far, y},
             {x + near, y + near},
             {x, y + far},
             {x - near, y + near},
             {x - far, y},
             {x - near, y - near},
             {x, y - far},
             {x + near, y - near}}};
}

// The shortest way round some of the discs: A* over the corners of the space and of their octagons.
class DetourSearch {
public:
    DetourSearch(const Mesh& mesh, const RouteGraph& graph, Point start, Point goal, const std::vector<Disc>& all,
                 const std::vector<Disc>& discs)
        : mesh_(mesh), graph_(graph), start_(start), goal_(goal), discs_(discs), corners_(graph.vertex.size()) {
        free_ = {start, goal};
        for (const Disc& disc : discs) {
            for (const Point at : octagon_around(disc)) {
                const auto clear_of = [&](const Disc& other) { return other.is_clear_of(at); };
                if (std::ranges::all_of(all, clear_of) && strictly_inside(mesh, at.x, at.y)) free_.push_back(at);
            }
        }
        links_.resize(index(corners_));
        for (i64 i = 0; i < static_cast<i64>(free_.size()); ++i) {
            seen_.push_back(corners_seen_from(mesh, graph, free_[index(i)]));
            for (const i64 corner : seen_.back()) links_[index(corner)].push_back(corners_ + i);
        }
    }

    std::vector<Point> run() {
        const std::size_t nodes = index(corners_) + free_.size();
        travelled_.assign(nodes, UNREACHED);
        bound_.assign(nodes, UNREACHED);
        before_.assign(nodes, -1);
        open(start_node(), 0.0, -1);
        while (!queue_.empty()) {
            const auto [nearest, node] = queue_.top();
            queue_.pop();
            if (node == goal_node()) return path();
            if (nearest != bound_[index(node)]) continue;  // it has been opened again, nearer
            bound_[index(node)] = UNREACHED;
            expand(node);
        }
        return {};
    }

private:
    i64 start_node() const { return corners_; }
    i64 goal_node() const { return corners_ + 1; }
    Point at(i64 node) const {
        return node < corners_ ? mesh_.vertex(graph_.vertex[node]) : free_[index(node - corners_)];
    }

    void expand(i64 node) {
        if (node < corners_) {
            for (i64 leg = graph_.leg_start[node]; leg < graph_.leg_start[node + 1]; ++leg) {
                try_leg(node, graph_.leg_end[leg], graph_.leg_length[leg]);
            }
            for (const i64 other : links_[index(node)]) try_leg(node, other, length_of_leg(at(node), at(other)));
            return;
        }
        for (const i64 corner : seen_[index(node - corners_)]) {
            try_leg(node, corner, length_of_leg(at(node), at(corner)));
        }
        const Point here = at(node);
        const i64 triangle = locate(mesh_, here.x, here.y);
        for (i64 other = corners_; other < corners_ + static_cast<i64>(free_.size()); ++other) {
            const Point there = at(other);
            const f64 length = length_of_leg(here, there);
            if (travelled_[index(node)] + length >= travelled_[index(other)] || !is_clear(node, other)) continue;
            if (line_of_sight(mesh_, here.x, here.y, triangle, there.x, there.y)) try_leg(node, other, length);
        }
    }

    void try_leg(i64 node, i64 other, f64 length) {
        const f64 travelled = travelled_[index(node)] + length;
        if (travelled < travelled_[index(other)] && is_clear(node, other)) open(other, travelled, node);
    }

    bool is_clear(i64 node, i64 other) const {
        const Point a = at(node), b = at(other);
        return std::ranges::all_of(discs_, [&](const Disc& disc) {
            const bool is_left = node == start_node() && !disc.is_clear_of(a);
            return is_left ? disc.is_left_by(a, b) && disc.is_clear_of(b) : disc.is_clear_of(a, b);
        });
    }

    void open(i64 node, f64 travelled, i64 from) {
        travelled_[index(node)] = travelled;
        bound_[index(node)] = travelled + length_of_leg(at(node), goal_);
        before_[index(node)] = from;
        queue_.emplace(bound_[index(node)], node);
    }

    std::vector<Point> path() const {
        std::vector<Point> points;
        for (i64 node = goal_node(); node >= 0; node = before_[index(node)]) points.push_back(at(node));
        std::reverse(points.begin(), points.end());
        return points;
    }

    using Entry = std::pair<f64, i64>;  // bound and node: of equal bounds, the lower node comes first

    const Mesh& mesh_;
    const RouteGraph& graph_;
    Point start_, goal_;
    const std::vector<Disc>& discs_;
    i64 corners_;                          // nodes below are corners of the space, then come the free ones
    std::vector<Point> free_;              // the start, the goal, and the corners of octagons
    std::vector<std::vector<i64>> seen_;   // the corners of the space that each of them sees
    std::vector<std::vector<i64>> links_;  // the free ones that each corner of the space sees
    std::vector<f64> travelled_, bound_;
    std::vector<i64> before_;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

// Whether a way hits a disc: all legs keep clear of it, but for a first one that leads out of it.
bool is_in_the_way(const Disc& disc, const std::vector<Point>& way) {
    for (std::size_t i = 0; i + 1 < way.size(); ++i) {
        const bool is_left = i == 0 && !disc.is_clear_of(way[0]);
        const bool is_clear = is_left ? disc.is_left_by(way[0], way[1]) && disc.is_clear_of(way[1])
                                      : disc.is_clear_of(way[i], way[i + 1]);
        if (!is_clear) return true;
    }
    return false;
}

}  // namespace

bool Disc::is_clear_of(Point a, Point b) const {
    const i64 dx = b.x - a.x, dy = b.y - a.y, px = at.x - a.x, py = at.y - a.y;
    const i64 along = px * dx + py * dy, whole = dx * dx + dy * dy;
    if (along <= 0) return is_clear_of(a);
    if (along >= whole) return is_clear_of(b);
    const f64 beside = static_cast<f64>(px * dy - py * dx), near = static_cast<f64>(reach);
    return beside * beside > near * near * static_cast<f64>(whole);
}

std::vector<Point> find_detour(const Mesh& mesh, const RouteGraph& graph, Point start, Point goal,
                               const std::vector<Disc>& discs) {
    if (!std::ranges::all_of(discs, [&](const Disc& disc) { return disc.is_clear_of(goal); })) return {};
    std::vector<Disc> met;  // those in the way so far
    std::vector<bool> is_met(discs.size(), false);
    std::vector<Point> way = find_route(mesh, graph, start, goal);
    while (!way.empty()) {
        const std::size_t before = met.size();
        for (std::size_t i = 0; i < discs.size(); ++i) {
            if (is_met[i] || !is_in_the_way(discs[i], way)) continue;
            is_met[i] = true;
            met.push_back(discs[i]);
        }
        if (met.size() == before) return way;
        way = DetourSearch(mesh, graph, start, goal, discs, met).run();
    }
    return {};
}

std::optional<Point> place_beside(const Floor& floor, Point place, Point from, i64 slack,
                                  const std::vector<Disc>& discs) {
    const auto shape = floor.part_of_cell.shape;
    const GridCell middle{floor_div(place.y, SUB), floor_div(place.x, SUB)};
    const i64 farthest = std::max({middle.row, shape[0] - middle.row, middle.column, shape[1] - middle.column});
    struct Found {
        f64 away;  // from the place
        Point at;
    };
    std::vector<Found> found;
    f64 nearest = UNREACHED;
    const auto look_at = [&](GridCell cell) {
        if (!is_inside(shape, cell) || !floor.has(cell)) return;
        const Point centre{cell.column * SUB + CELL_CENTRE, cell.row * SUB + CELL_CENTRE};
        const f64 away = length_of_leg(place, centre);
        if (away > nearest + static_cast<f64>(slack)) return;
        if (!std::ranges::all_of(discs, [&](const Disc& disc) { return disc.is_clear_of(centre); })) return;
        nearest = std::min(nearest, away);
        found.push_back({away, centre});
    };
    // Squares of cells around it: a cell of a square isn't nearer than its number of cells, less one.
    for (i64 ring = 0; ring <= farthest && static_cast<f64>((ring - 1) * SUB) <= nearest + static_cast<f64>(slack);
         ++ring) {
        for (i64 row = middle.row - ring; row <= middle.row + ring; ++row) {
            const bool is_side = row == middle.row - ring || row == middle.row + ring;
            for (i64 column = middle.column - ring; column <= middle.column + ring;
                 column += is_side || ring == 0 ? 1 : 2 * ring) {
                look_at({row, column});
            }
        }
    }
    std::optional<Found> best;
    const auto comes_before = [&](const Found& one, const Found& other) {
        const f64 a = length_of_leg(from, one.at), b = length_of_leg(from, other.at);
        return std::tuple(a, one.away, one.at.y, one.at.x) < std::tuple(b, other.away, other.at.y, other.at.x);
    };
    for (const Found& one : found) {
        if (one.away > nearest + static_cast<f64>(slack)) continue;
        if (!best || comes_before(one, *best)) best = one;
    }
    return best ? std::optional(best->at) : std::nullopt;
}

}  // namespace fleet2d
