#include "legs.hpp"

#include <bit>
#include <cmath>
#include <cstdlib>

namespace fleet2d {

i64 Waits::draw(StepDraws& draws, Bits& bits) const {
    const u64 count = static_cast<u64>(std::bit_width(quantiles.size())) - 1;
    return quantiles[static_cast<std::size_t>(bits.take(draws, count))];
}

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
                                        StepDraws& draws, Bits& bits) {
    while (next < until) {
        if (next > now.time) {
            now.time = next;
            mark(now);
        }
        const i64 side = bits.take(draws, aside.side_bits) - (i64{1} << aside.side_bits) / 2;
        now = turn(now, turn_between(now.heading, (aside.facing + side) & (TURN - 1)), turn_rate);
        next = now.time + aside.waits.draw(draws, bits);
    }
    return {now, next};
}

Moment Legs::walk(Moment now, View<const i64, 2> route, f64 speed, f64 turn_rate) {
    Moment end{now.time, route(0, 0), route(0, 1), now.heading, 0};
    walk_route(route, now.time, now.heading, speed, turn_rate, [&](i64 time, i64 x, i64 y, i64 heading) {
        end = {time, x, y, heading, 0};
        mark(end);
    });
    end.away = now.away;
    return end;
}

Moment Legs::step_to(Moment now, Point at, f64 speed, f64 turn_rate) {
    const i64 route[] = {now.x, now.y, at.x, at.y};
    return now.x == at.x && now.y == at.y ? now : walk(now, {route, {2, 2}}, speed, turn_rate);
}

Moment Legs::settle(Moment now, Point at, i64 heading, f64 speed, f64 turn_rate) {
    now = step_to(now, at, speed, turn_rate);
    return turn(now, turn_between(now.heading, heading), turn_rate);
}

Array<i64, 2> Legs::rows() const {
    auto result = Array<i64, 2>::empty({size(), 5});
    i64* row = result.data();
    for (const auto& numbers : rows_) row = std::copy(numbers.begin(), numbers.end(), row);
    return result;
}

}  // namespace fleet2d
