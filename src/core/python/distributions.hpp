// Distributions as Python holds them.
#pragma once

#include <nanobind/stl/vector.h>

#include "../planner.hpp"
#include "arrays.hpp"

namespace fleet2d {

inline constexpr i64 LONGEST_TIME = i64{1} << 36;  // s: products with fractions of a position fit in 64 bits
inline constexpr i64 MAX_DRAWN = i64{1} << 31;     // bounds of draws are below it
inline constexpr i64 LATEST_TIME = i64{1} << 20;   // s since midnight: else a day might have events by the million

using Numbers = std::vector<i64>;

// Quantiles, the least and the largest value, and the positions of these among the quantiles.
using DistributionRow = std::tuple<std::vector<i64>, i64, i64, i64, i64>;

inline bool is_time(i64 number) { return -LONGEST_TIME < number && number < LONGEST_TIME; }

inline Distribution distribution_of(const DistributionRow& row) {
    const auto& [knots, shortest, longest, first, last] = row;
    require(!knots.empty() && std::is_sorted(knots.begin(), knots.end()), "quantiles must ascend, one or more");
    require(is_time(knots.front()) && is_time(knots.back()) && is_time(shortest) && is_time(longest),
            "times must be within 2**36 s");
    const i64 top = (static_cast<i64>(knots.size()) - 1) << Distribution::BITS;
    require(0 <= first && first <= top && 0 <= last && last <= top && last - first < MAX_DRAWN,
            "positions must be among the quantiles, less than 2**31 apart");
    return {knots, shortest, longest, first, last};
}

}  // namespace fleet2d
