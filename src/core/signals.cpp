#include "signals.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "lattice.hpp"
#include "measure.hpp"

namespace fleet2d {
namespace {

constexpr f64 FAR_AWAY = std::numeric_limits<f64>::infinity();

f64 root(i64 squared) { return std::sqrt(static_cast<f64>(squared)); }

// The squared distance from a point to an edge; exact up to the rounding of one division.
f64 squared_to_edge(i64 x, i64 y, View<const i64> edge) {
    const i64 dx = edge[2] - edge[0], dy = edge[3] - edge[1], px = x - edge[0], py = y - edge[1];
    const i64 along = px * dx + py * dy, length = dx * dx + dy * dy;
    if (along <= 0 || length == 0) return static_cast<f64>(px * px + py * py);
    if (along >= length) {
        const i64 qx = x - edge[2], qy = y - edge[3];
        return static_cast<f64>(qx * qx + qy * qy);
    }
    const f64 cross = static_cast<f64>(px * dy - py * dx);
    return cross * cross / static_cast<f64>(length);
}

// Whether a ray from the point along +x crosses an edge.
bool is_crossed(i64 x, i64 y, View<const i64> edge) {
    if ((edge[1] > y) == (edge[3] > y)) return false;
    const i64 cross = (edge[2] - edge[0]) * (y - edge[1]) - (x - edge[0]) * (edge[3] - edge[1]);
    return edge[3] > edge[1] ? cross > 0 : cross < 0;
}

f64 distance_to_shape(i64 x, i64 y, View<const i64, 2> edges) {
    f64 nearest = FAR_AWAY;
    bool inside = false;
    for (i64 k = 0; k < edges.size(); ++k) {
        nearest = std::min(nearest, squared_to_edge(x, y, edges[k]));
        inside ^= is_crossed(x, y, edges[k]);
    }
    return inside ? 0.0 : std::sqrt(nearest);
}

}  // namespace

OwnedStretched distances_between(const Window& window, i64 body, i64 other) {
    OwnedStretched distances;
    i64 a = window.start[body], b = window.start[other];
    i64 step = window.first;
    while (step < window.end) {
        const i64 dx = window.x[a] - window.x[b], dy = window.y[a] - window.y[b];
        const bool away = window.away[a] != 0 || window.away[b] != 0;
        distances.append(step, away ? FAR_AWAY : root(dx * dx + dy * dy));
        const i64 a_ends = window.run_end(body, a), b_ends = window.run_end(other, b);
        step = std::min(a_ends, b_ends);
        if (step == a_ends) ++a;
        if (step == b_ends) ++b;
    }
    return distances;
}

OwnedStretched distances_to_shape(const Window& window, i64 body, View<const i64, 2> edges) {
    OwnedStretched distances;
    i64 x = 0, y = 0;
    f64 known = -1;
    for (i64 run = window.start[body]; run < window.start[body + 1]; ++run) {
        const bool moved = known < 0 || window.x[run] != x || window.y[run] != y;
        x = window.x[run], y = window.y[run];
        if (moved) known = distance_to_shape(x, y, edges);
        distances.append(window.step[run], window.away[run] != 0 ? FAR_AWAY : known);
    }
    return distances;
}

OwnedStretched speeds(const Window& window, i64 body, View<const i64> before, View<const i64, 2> portals) {
    OwnedStretched speeds;
    const i64 begin = window.start[body];
    bool is_known = before.size() > 0;
    i64 x = is_known ? before[0] : 0, y = is_known ? before[1] : 0, away = is_known ? before[2] : 0;
    for (i64 run = begin; run < window.start[body + 1]; ++run) {
        const i64 step = window.step[run], dx = window.x[run] - x, dy = window.y[run] - y;
        const bool is_there = is_known && away == 0 && window.away[run] == 0;
        const f64 length = is_there ? root(dx * dx + dy * dy) : 0.0;
        speeds.append(step, without_portal(length, x, y, window.x[run], window.y[run], portals));
        if (window.run_end(body, run) > step + 1) speeds.append(step + 1, 0.0);
        x = window.x[run], y = window.y[run], away = window.away[run], is_known = true;
    }
    return speeds;
}

OwnedStretched sliding_max(const Stretched& signal, i64 low, i64 high, f64 before, f64 after) {
    OwnedStretched greatest;
    if (signal.size() == 0) return greatest;
    const i64 first = signal.start[0], end = signal.end, count = signal.size();
    // Stretch -1 is what came before, stretch `count` what comes after.
    const auto begins = [&](i64 i) { return i < count ? signal.start[i] : end; };
    const auto value = [&](i64 i) { return i < 0 ? before : i < count ? signal.value[i] : after; };
    std::deque<i64> window;  // of descending value
    i64 next = -1, step = first;
    while (step < end) {
        // Stretch `next` is in the window of a step from begins(next) - high on, stretch -1 from ever.
        while (next <= count && (next < 0 || begins(next) - high <= step)) {
            while (!window.empty() && value(window.back()) <= value(next)) window.pop_back();
            window.push_back(next++);
        }
        // A stretch has left the window once the next one begins at or before its first step.
        while (window.front() < count && begins(window.front() + 1) <= step + low) window.pop_front();
        greatest.append(step, value(window.front()));
        i64 change = end;
        if (next <= count) change = std::min(change, begins(next) - high);
        if (window.front() < count) change = std::min(change, begins(window.front() + 1) - low);
        step = std::max(change, step + 1);
    }
    return greatest;
}

OwnedStretched until(View<const i64> start, View<const f64> hold, View<const f64> goal, f64 after) {
    const i64 count = start.size();
    std::vector<f64> values(static_cast<std::size_t>(count));
    f64 later = after;
    for (i64 i = count - 1; i >= 0; --i) {
        // Within a stretch it is the same at each step: once more doesn't change it.
        later = std::max(goal[i], std::min(hold[i], later));
        values[static_cast<std::size_t>(i)] = later;
    }
    OwnedStretched result;
    for (i64 i = 0; i < count; ++i) result.append(start[i], values[static_cast<std::size_t>(i)]);
    return result;
}

}  // namespace fleet2d
