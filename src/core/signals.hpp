// Signals of a run as stretches of equal value: how far bodies are apart, and windows over time.
#pragma once

#include <vector>

#include "timelines.hpp"

namespace fleet2d {

// A signal over the steps start[0] to `end` - 1: value[i] holds from start[i] until the next stretch begins.
struct Stretched {
    View<const i64> start;
    View<const f64> value;
    i64 end = 0;

    i64 size() const { return start.size(); }
};

// A signal that owns its arrays. Neighbours differ in value.
struct OwnedStretched {
    std::vector<i64> start;
    std::vector<f64> value;

    void append(i64 step, f64 next) {
        if (!value.empty() && value.back() == next) return;
        start.push_back(step);
        value.push_back(next);
    }
};

// The distance between the centres of two bodies [lattice units], infinite while one is away.
OwnedStretched distances_between(const Window& window, i64 body, i64 other);

// The distance from the centre of a body to a shape [lattice units], 0 inside it, infinite while away. Each row of
// `edges`, (n, 4), is an edge from (x, y) to (x, y); where they are closed rings, even-odd tells what is inside.
OwnedStretched distances_to_shape(const Window& window, i64 body, View<const i64, 2> edges);

// The speed of a body [lattice units a step]: at each step the way from the step before, 0 at a step before which
// the body was nowhere. `before` is where it was at the step before the window, (x, y, away), or empty; `portals` are
// as `without_portal` has them.
OwnedStretched speeds(const Window& window, i64 body, View<const i64> before, View<const i64, 2> portals);

// The greatest value of a signal in the steps t + low to t + high, for each t; before the first step the signal
// counts as `before`, from the end on as `after`.
OwnedStretched sliding_max(const Stretched& signal, i64 low, i64 high, f64 before, f64 after);

// How well `hold` holds until `goal` does, from each step on; both have the same stretches. `after` is what it would
// be at the end.
OwnedStretched until(View<const i64> start, View<const f64> hold, View<const f64> goal, f64 after);

}  // namespace fleet2d
