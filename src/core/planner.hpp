// The planner of days: draws jobs and pastimes from waking to the next waking, within all bounds of a template.
//
// Times are seconds since the midnight of the day. Activities are numbers.
#pragma once

#include <optional>
#include <vector>

#include "random.hpp"

namespace fleet2d {

// A distribution over whole seconds: quantiles at evenly spaced probabilities, between bounds.
struct Law {
    static constexpr int BITS = 24;  // of the fraction in a position among the knots

    std::vector<i64> knots;  // ascending
    i64 shortest, longest;
    i64 first, last;  // positions of these among the knots

    i64 middle() const { return knots[knots.size() / 2]; }
    // The position of a value among the knots.
    i64 position(i64 value) const;
    // A value from the law, conditional on being at most `high`; `high` if the law has none.
    i64 draw(StepDraws& draws, i64 high) const;
};

struct Job {
    i64 activity;
    std::optional<Law> starts;  // none: right after the job before it, on waking or before bed
    Law takes;
    i64 until;               // its latest end
    std::vector<i64> after;  // numbers of the jobs before it, all lower than its own
    i64 chance;              // of it on a day [per million]
    bool needed;             // must not be left out if a day is too full
    i64 place;               // -1 on waking, 1 before bed, else 0

    // Whether it begins right after another job.
    bool follows() const { return !starts && place == 0; }
};

struct Pastime {
    i64 activity;
    i64 weight;
    Law takes;
    i64 first, last;  // it may begin in between
};

struct DayPlan {
    Law sleep;
    i64 least_sleep;
    std::vector<Job> jobs;
    std::vector<Pastime> pastimes;
    i64 rest, asleep;  // activities
};

struct Doing {
    i64 activity, begin, end;
    i64 job;  // its number, -1: none
};

// The doings from `wake` to `next_wake`, without a gap; none if the jobs that are needed don't fit.
std::vector<Doing> plan_day(const DayPlan& plan, StepDraws& draws, i64 wake, i64 next_wake);

}  // namespace fleet2d
