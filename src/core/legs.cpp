#include "legs.hpp"

#include <bit>
#include <cmath>
#include <cstdlib>

namespace fleet2d {

Moment Legs::turn(Moment now, i64 headings, f64 turn_rate) {
    const i64 sign = headings > 0 ? 1 : -1;
    for (i64 left = std::abs(headings); left > 0;) {
        const i64 part = std::min(left, TURN / 3);
        left -= part;
        now.time = later(now.time, static_cast<f64>(part) * 1e6 / turn_rate);
        now.heading = (now.heading + sign * part) & (TURN - 1);
        mark(now);
    }
    return now;
}

std::pair<Moment, i64> Legs::turn_aside(Moment now, f64 turn_rate, const Aside& aside, i64 next, i64 until,
                                        const Draw& draw) {
    const u64 wait_bits = static_cast<u64>(std::bit_width(static_cast<u64>(aside.waits.size())) - 1);
    while (next < until) {
        if (next > now.time) {
            now.time = next;
            mark(now);
        }
        const i64 side = draw(aside.side_bits) - (i64{1} << aside.side_bits) / 2;
        now = turn(now, turn_between(now.heading, (aside.facing + side) & (TURN - 1)), turn_rate);
        next = now.time + aside.waits[draw(wait_bits)];
    }
    return {now, next};
}

Moment Legs::walk(Moment now, View<const i64, 2> route, f64 speed, f64 turn_rate) {
    const auto timed = time_route(route, now.time, now.heading, speed, turn_rate);
    const View<const i64, 2> rows = timed;
    for (i64 i = 1; i < rows.size(); ++i) mark({rows(i, 0), rows(i, 1), rows(i, 2), rows(i, 3), 0});
    const View<const i64> last = rows[rows.size() - 1];
    return {last[0], last[1], last[2], last[3], now.away};
}

Moment Legs::settle(Moment now, Point at, i64 heading, f64 speed, f64 turn_rate) {
    if (now.x != at.x || now.y != at.y) {
        const i64 route[] = {now.x, now.y, at.x, at.y};
        now = walk(now, {route, {2, 2}}, speed, turn_rate);
    }
    return turn(now, turn_between(now.heading, heading), turn_rate);
}

Array<i64, 2> Legs::rows() const {
    auto result = Array<i64, 2>::empty({size(), 5});
    i64* row = result.data();
    for (const auto& numbers : rows_) row = std::copy(numbers.begin(), numbers.end(), row);
    return result;
}

}  // namespace fleet2d
