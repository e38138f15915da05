#include "routes.hpp"

#include <algorithm>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "line_of_sight.hpp"
#include "random.hpp"

namespace fleet2d {
namespace {

constexpr f64 INFINITE = std::numeric_limits<f64>::infinity();

f64 gap(Point a, Point b) { return distance(a.x, a.y, b.x, b.y); }

// Whether a string from a point can bend round the corner `node`.
bool is_taut(const Mesh& mesh, const Corners& corners, i64 node, Point from) {
    if (!corners.simple[node]) return true;
    const Point at = mesh.vertex(corners.vertex[node]);
    const i64 before = orient(from.x, from.y, at.x, at.y, corners.before(node, 0), corners.before(node, 1));
    const i64 after = orient(from.x, from.y, at.x, at.y, corners.after(node, 0), corners.after(node, 1));
    return !((before > 0 && after < 0) || (before < 0 && after > 0));
}

// Finds the corners in sight; what it returns is valid until it is asked again.
struct Finder {
    const Mesh& mesh;
    Corners corners;
    View<const i32> node_of_vertex;
    Scratch scratch{mesh};
    Array<i32> seen = Array<i32>::empty({mesh.vertex_count() + 4});

    // The corners that one taut leg connects with `node`, in no particular order.
    View<const i32> from_corner(const Fans& fans, i64 node) {
        const i64 vertex = corners.vertex[node];
        const Point at = mesh.vertex(vertex);
        const i64 count = vertices_seen_from_vertex(mesh, fans, vertex, seen, scratch);
        return keep(count, [&](i64 other) {
            return is_taut(mesh, corners, other, at) &&
                   is_taut(mesh, corners, node, mesh.vertex(corners.vertex[other]));
        });
    }

    // The corners that a taut string from a point can reach, in no particular order.
    View<const i32> from_point(Point at, i64 triangle) {
        const i64 count = vertices_seen_from_point(mesh, at.x, at.y, triangle, seen, scratch);
        return keep(count, [&](i64 node) { return is_taut(mesh, corners, node, at); });
    }

private:
    // The corners among the first vertices in `seen`, those that are to be kept.
    template <class Kept>
    View<const i32> keep(i64 count, Kept is_kept) {
        i64 nodes = 0;
        for (i64 i = 0; i < count; ++i) {
            const i32 node = node_of_vertex[seen[i]];
            if (node >= 0 && is_kept(node)) seen[nodes++] = node;
        }
        return seen.view().slice(0, nodes);
    }
};

// A* from the corners that the start sees (`open` them) to those that the goal sees (set `to_goal`).
struct Search {
    const Mesh& mesh;
    const RouteGraph& graph;
    Point goal;
    std::array<i64, 1> nodes = graph.vertex.shape();
    Array<f64> to_goal = Array<f64>::filled(nodes, -1);          // length of the last leg, where the goal is seen
    Array<f64> travelled = Array<f64>::filled(nodes, INFINITE);  // from the start
    Array<f64> bound = Array<f64>::filled(nodes, INFINITE);      // travelled + straight line to the goal, if open
    Array<i32> before = Array<i32>::filled(nodes, -1);           // the corner before; -1 = the start
    using Entry = std::pair<f64, i64>;                           // bound and corner
    // Of equal bounds the lower corner comes first. (The order of pairs themselves allows for NaN, which takes longer.)
    struct IsLater {
        bool operator()(const Entry& a, const Entry& b) const {
            return a.first == b.first ? a.second > b.second : a.first > b.first;
        }
    };
    std::priority_queue<Entry, std::vector<Entry>, IsLater> queue{};

    Point at(i64 node) const { return mesh.vertex(graph.vertex[node]); }

    // Go to a corner from the one before it.
    void open(i64 node, f64 length, i64 from) {
        travelled[node] = length;
        bound[node] = length + gap(at(node), goal);
        before[node] = static_cast<i32>(from);
        queue.emplace(bound[node], node);
    }

    // The last corner of the shortest path; -1 if there is none.
    i64 run() {
        f64 best = INFINITE;
        i64 last = -1;
        while (!queue.empty() && queue.top().first < best) {
            const auto [nearest, node] = queue.top();
            queue.pop();
            if (nearest != bound[node]) continue;  // it has been opened again, nearer
            bound[node] = INFINITE;
            if (to_goal[node] >= 0 && travelled[node] + to_goal[node] < best) {
                best = travelled[node] + to_goal[node];
                last = node;
            }
            for (i64 leg = graph.leg_start[node]; leg < graph.leg_start[node + 1]; ++leg) {
                const i64 other = graph.leg_end[leg];
                const f64 length = travelled[node] + graph.leg_length[leg];
                if (length < travelled[other]) open(other, length, node);
            }
        }
        return last;
    }

    // The path from `start` by the corners up to `last` to the goal.
    std::vector<Point> path(Point start, i64 last) {
        std::vector<Point> points{goal};
        for (i64 node = last; node >= 0; node = before[node]) points.push_back(at(node));
        points.push_back(start);
        std::reverse(points.begin(), points.end());
        return points;
    }
};

}  // namespace

RouteGraph build_route_graph(const Mesh& mesh, const Corners& corners) {
    const i64 nodes = corners.vertex.size();
    RouteGraph graph;
    graph.vertex = Array<i64>::copy_of(corners.vertex);
    graph.before = Array<i64, 2>::copy_of(corners.before);
    graph.after = Array<i64, 2>::copy_of(corners.after);
    graph.simple = Array<bool>::copy_of(corners.simple);
    graph.node_of_vertex = Array<i32>::filled({mesh.vertex_count()}, -1);
    for (i64 node = 0; node < nodes; ++node) graph.node_of_vertex[corners.vertex[node]] = static_cast<i32>(node);

    const Fans fans = build_fans(mesh);
    Finder finder{mesh, corners, graph.node_of_vertex};
    std::vector<i32> ends;
    std::vector<f64> lengths;
    graph.leg_start = Array<i32>::zeros({nodes + 1});
    for (i64 node = 0; node < nodes; ++node) {
        const View<const i32> seen = finder.from_corner(fans, node);
        ends.insert(ends.end(), seen.begin(), seen.end());
        std::sort(ends.end() - seen.size(), ends.end());
        const Point at = mesh.vertex(corners.vertex[node]);
        for (std::size_t leg = lengths.size(); leg < ends.size(); ++leg) {
            lengths.push_back(gap(at, mesh.vertex(corners.vertex[ends[leg]])));
        }
        graph.leg_start[node + 1] = static_cast<i32>(ends.size());
    }
    const i64 legs = static_cast<i64>(ends.size());
    graph.leg_end = Array<i32>::copy_of({ends.data(), {legs}});
    graph.leg_length = Array<f64>::copy_of({lengths.data(), {legs}});
    return graph;
}

std::vector<i64> corners_seen_from(const Mesh& mesh, const RouteGraph& graph, Point at) {
    const i64 triangle = locate(mesh, at.x, at.y);
    if (triangle == OUTSIDE) return {};
    Finder finder{mesh, graph.corners(), graph.node_of_vertex};
    const View<const i32> seen = finder.from_point(at, triangle);
    return {seen.begin(), seen.end()};
}

std::vector<Point> find_route(const Mesh& mesh, const RouteGraph& graph, Point start, Point goal) {
    const i64 start_triangle = locate(mesh, start.x, start.y), goal_triangle = locate(mesh, goal.x, goal.y);
    if (start_triangle == OUTSIDE || goal_triangle == OUTSIDE) return {};
    if ((start.x == goal.x && start.y == goal.y) ||
        line_of_sight(mesh, start.x, start.y, start_triangle, goal.x, goal.y)) {
        return {start, goal};
    }
    Search search{mesh, graph, goal};
    Finder finder{mesh, graph.corners(), graph.node_of_vertex};
    for (const i32 node : finder.from_point(goal, goal_triangle)) search.to_goal[node] = gap(search.at(node), goal);
    for (const i32 node : finder.from_point(start, start_triangle)) {
        search.open(node, gap(start, search.at(node)), -1);
    }
    const i64 last = search.run();
    return last < 0 ? std::vector<Point>{} : search.path(start, last);
}

KnownRoutes::Slot& KnownRoutes::slot_of(Small start, Small goal) {
    const auto bits = [](Small at) { return static_cast<u64>(static_cast<u32>(at.x)) << 32 | static_cast<u32>(at.y); };
    const std::size_t last = slots_.size() - 1;
    std::size_t i = random_bits(bits(start), bits(goal)) & last;
    while (slots_[i].count > 0 && !(slots_[i].start == start && slots_[i].goal == goal)) i = (i + 1) & last;
    return slots_[i];
}

void KnownRoutes::put(Small start, Small goal, const std::vector<Point>& route) {
    if (size_ >= MOST) {
        size_ = 0;
        slots_.assign(16, {});
        points_.clear();
    }
    if (2 * size_ >= slots_.size()) {
        const std::vector<Slot> slots = std::exchange(slots_, std::vector<Slot>(2 * slots_.size()));
        for (const Slot& slot : slots) {
            if (slot.count > 0) slot_of(slot.start, slot.goal) = slot;
        }
    }
    Slot& slot = slot_of(start, goal);
    if (slot.count > 0) return;  // another thread was quicker
    slot = {start, goal, static_cast<u32>(points_.size()), static_cast<u32>(route.size())};
    for (const Point at : route) points_.push_back({static_cast<i32>(at.x), static_cast<i32>(at.y)});
    ++size_;
}

std::vector<Point> KnownRoutes::find(const Mesh& mesh, const RouteGraph& graph, Point start, Point goal) {
    for (const i64 number : {start.x, start.y, goal.x, goal.y}) {
        if (number != static_cast<i32>(number)) return {};  // no home is there
    }
    const Small from{static_cast<i32>(start.x), static_cast<i32>(start.y)};
    const Small to{static_cast<i32>(goal.x), static_cast<i32>(goal.y)};
    std::vector<Point> points;
    const auto known = [&] {
        const Slot& slot = slot_of(from, to);
        points.reserve(slot.count);
        for (u32 i = 0; i < slot.count; ++i) points.push_back({points_[slot.begin + i].x, points_[slot.begin + i].y});
        return slot.count > 0;
    };
    {
        const std::lock_guard lock(mutex_);
        if (known()) return points;
    }
    if (!strictly_inside(mesh, start.x, start.y) || !strictly_inside(mesh, goal.x, goal.y)) return {};
    points = find_route(mesh, graph, start, goal);
    if (points.empty()) return points;
    const std::lock_guard lock(mutex_);
    put(from, to, points);
    return points;
}

}  // namespace fleet2d
