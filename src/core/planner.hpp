// The planner of days: draws jobs and pastimes from waking to the next waking, within all bounds of a template.
//
// Times are seconds since the midnight of the day. Activities are numbers.
#pragma once

#include <optional>
#include <vector>

#include "random.hpp"
#include "room_use.hpp"

namespace fleet2d {

inline constexpr i64 NO_GAP_S = 300;  // a shorter gap is not filled: the next episode begins at once

// A distribution over whole seconds: quantiles at evenly spaced probabilities, between bounds.
struct Distribution {
    static constexpr int BITS = 24;  // of the fraction in a position among the knots

    std::vector<i64> knots;  // ascending
    i64 shortest, longest;
    i64 first, last;  // positions of these among the knots

    i64 middle() const { return knots[knots.size() / 2]; }
    // The position of a value among the knots.
    i64 position(i64 value) const;
    // A value conditional on being at most `high`; `high` if all values are above it.
    i64 draw(StepDraws& draws, i64 high) const;
};

struct Job {
    i64 activity;
    std::optional<Distribution> starts;  // none: right after the job before it, on waking or before bed
    Distribution takes;
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
    Distribution takes;
    i64 first, last;  // it may begin in between
};

struct DayPlan {
    Distribution sleep;
    i64 min_sleep;
    std::vector<Job> jobs;
    std::vector<Pastime> pastimes;
    i64 rest, asleep;  // activities
};

struct Episode {
    i64 activity, begin, end;
    i64 job;  // its number, -1: none
    i64 room = ANY_ROOM;
};

// Jobs in the order of a day. The last of `preferred` and of `latest` is that of going to bed.
struct JobOrder {
    std::vector<std::size_t> jobs;
    std::vector<i64> preferred;  // the drawn beginning
    std::vector<i64> latest;     // the latest possible beginning
    bool fits = false;           // whether all of them fit into the day
};

// Draw the order of some jobs, by their preferred beginnings or else by their latest ones.
JobOrder draw_order(const DayPlan& plan, StepDraws& draws, const std::vector<bool>& chosen, i64 wake, i64 next_wake,
                    bool by_deadline);

// The episodes from `wake` to `next_wake`, without a gap; none if the jobs that are needed don't fit. A job whose rooms
// others use all the time is left out.
std::vector<Episode> plan_day(const DayPlan& plan, StepDraws& draws, i64 wake, i64 next_wake,
                              const PrivateRooms* rooms = nullptr);

}  // namespace fleet2d
