#include "../signals.hpp"

#include "poses.hpp"
#include "subjects.hpp"
#include "timelines.hpp"

namespace fleet2d {
namespace {

using Pair = std::tuple<Array<i64>, Array<f64>>;

constexpr i64 FARTHEST_SIGNAL = i64{1} << 28;  // lattice units: products of differences stay inside 64 bits
constexpr i64 LONGEST_RUN = i64{1} << 60;      // steps

Pair arrays_of(const OwnedStretched& signal) {
    const auto size = static_cast<i64>(signal.start.size());
    return {Array<i64>::copy_of({signal.start.data(), {size}}), Array<f64>::copy_of({signal.value.data(), {size}})};
}

void check_body(const Window& window, i64 body) {
    require(0 <= body && body < window.bodies(), "there is no such body");
    require(all_in_range(window.x, -FARTHEST_SIGNAL, FARTHEST_SIGNAL) &&
                all_in_range(window.y, -FARTHEST_SIGNAL, FARTHEST_SIGNAL),
            "bodies must be within 2**28 lattice units");
}

void check_stretches(View<const i64> start, i64 size, i64 end) {
    require(start.size() == size, "start and values must have one length");
    bool ascend = true;
    for (i64 i = 1; i < start.size(); ++i) ascend &= start[i - 1] < start[i];
    require(ascend && (start.size() == 0 || start[start.size() - 1] < end), "start must ascend, and lie before end");
    require(all_in_range(start, -LONGEST_RUN, LONGEST_RUN) && end <= LONGEST_RUN, "steps must be within 2**60");
}

bool are_numbers(View<const f64> values) {
    bool numbers = true;
    for (const f64 value : values) numbers &= value == value;
    return numbers;
}

}  // namespace

void bind_signals(nb::module_& m) {
    m.def(
        "distances_between",
        [](const Window& window, i64 body, i64 other) {
            check_body(window, body);
            check_body(window, other);
            return arrays_of(distances_between(window, body, other));
        },
        "window"_a, "body"_a, "other"_a, Unlocked(),
        R"(Return how far the centres of two bodies are apart.

Args:
    window: The motion of the bodies.
    body: Number of one of them.
    other: Number of the other.

Returns:
    The steps at which the distance changes, int64 (n,), and what it is from then on [lattice units], float64 (n,);
    infinite while one of them is away.)");
    m.def(
        "distances_to_shape",
        [](const Window& window, i64 body, View<const i64, 2> edges) {
            check_body(window, body);
            require(edges.shape[1] == 4 && all_in_range(edges, -FARTHEST_SIGNAL, FARTHEST_SIGNAL),
                    "edges must be (n, 4), within 2**28 lattice units");
            return arrays_of(distances_to_shape(window, body, edges));
        },
        "window"_a, "body"_a, "edges"_a, Unlocked(),
        R"(Return how far the centre of a body is from a shape, 0 inside it.

Args:
    window: The motion of the bodies.
    body: Number of the body.
    edges: int64 (n, 4), edges from (x, y) to (x, y) [lattice units]; closed rings enclose an inside.

Returns:
    The steps at which the distance changes, int64 (n,), and what it is from then on [lattice units], float64 (n,);
    infinite while the body is away.)");
    m.def(
        "speeds",
        [](const Window& window, i64 body, View<const i64> before, View<const i64, 2> portals) {
            check_body(window, body);
            require(before.size() == 0 || before.size() == 3, "before must be (x, y, away), or empty");
            require(before.size() == 0 || all_in_range(before, -FARTHEST_SIGNAL, FARTHEST_SIGNAL),
                    "bodies must be within 2**28 lattice units");
            check_portals(portals);
            return arrays_of(speeds(window, body, before, portals));
        },
        "window"_a, "body"_a, "before"_a, "portals"_a, Unlocked(),
        R"(Return how far a body comes in each step: at a step, the way from the step before.

Args:
    window: The motion of the bodies.
    body: Number of the body.
    before: int64 (3,), x, y and away at the step before the window; (0,) if there was none.
    portals: int64 (m, 5), as for `sum_moves`.

Returns:
    The steps at which it changes, int64 (n,), and the way of each step from then on [lattice units], float64 (n,).)");
    m.def(
        "sliding_max",
        [](View<const i64> start, View<const f64> value, i64 end, i64 low, i64 high, f64 before, f64 after) {
            check_stretches(start, value.size(), end);
            require(-LONGEST_RUN <= low && low <= high && high <= LONGEST_RUN,
                    "low must be high at most, both within 2**60");
            require(are_numbers(value) && before == before && after == after, "values must be numbers");
            return arrays_of(sliding_max({start, value, end}, low, high, before, after));
        },
        "start"_a, "value"_a, "end"_a, "low"_a, "high"_a, "before"_a, "after"_a, Unlocked(),
        R"(Return the greatest value that a signal has from `low` to `high` steps after each step.

Args:
    start: int64 (n,), ascending, where the signal's stretches begin.
    value: float64 (n,), what it is in them.
    end: The step before which the last one ends.
    low: The first step of the window, from where it is asked about; negative before it.
    high: The last step of the window.
    before: What the signal is before the first step.
    after: What it is from `end` on.

Returns:
    The steps at which it changes, int64 (m,), and what it is from then on, float64 (m,).)");
    m.def(
        "until",
        [](View<const i64> start, View<const f64> hold, View<const f64> goal, f64 after) {
            check_stretches(start, hold.size(), LONGEST_RUN);
            require(goal.size() == hold.size(), "hold and goal must have one length");
            require(are_numbers(hold) && are_numbers(goal) && after == after, "values must be numbers");
            return arrays_of(until(start, hold, goal, after));
        },
        "start"_a, "hold"_a, "goal"_a, "after"_a, Unlocked(),
        R"(Return how well one signal holds until another one does, from each step on.

Args:
    start: int64 (n,), ascending, where the stretches of both begin.
    hold: float64 (n,), what must hold.
    goal: float64 (n,), until when.
    after: What comes after the last stretch.

Returns:
    The steps at which it changes, int64 (m,), and what it is from then on, float64 (m,).)");
}

}  // namespace fleet2d
