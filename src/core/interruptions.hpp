// The interruptions of a person's day: needs and errands, put into the activities that were planned.
//
// Times are seconds since the midnight of the day. Activities are numbers.
#pragma once

#include <optional>
#include <vector>

#include "random.hpp"
#include "room_use.hpp"

namespace fleet2d {

inline constexpr u64 CHANCE_BITS = 10, QUANTILE_BITS = 8;
inline constexpr i64 CERTAIN = i64{1} << CHANCE_BITS;

// What a part of a day is: as planned, an interruption, what goes on after one, or an interruption as the end.
enum class Role : i64 { PLANNED, INTERRUPTS, RESUMES, FINISHES };

using Quantiles = std::vector<i64>;  // 2**QUANTILE_BITS of them [s], 1 or more each

struct InterruptionStep {
    i64 activity;
    i64 chance;  // of CERTAIN
    Quantiles takes;
};

// A time of day.
struct Hours {
    i64 begin, length;
};

struct Need {
    std::vector<InterruptionStep> steps;
    Quantiles every;
    std::optional<Quantiles> asleep;
    i64 on_waking, before_bed, before_leaving, on_return;  // chances of CERTAIN
    i64 patience;
    std::optional<Hours> hours;
    std::vector<bool> met_by;  // (activities,)
};

struct Errand {
    InterruptionStep step;
    std::optional<std::vector<bool>> after, before;  // (activities,); all, if left out
};

struct InterruptionRules {
    std::vector<Need> needs;
    std::vector<Errand> errands;
    std::vector<bool> away, uninterruptible;  // (activities,)
    i64 sleep;                                // the activity
};

struct PlannedEpisode {
    i64 activity, begin, end;
    i64 room;
};

struct DayPart {
    i64 planned;  // number of the planned episode that it is a part of, -1 for an interruption
    i64 activity, begin, end;
    Role role;
    i64 room;
};

// A day with interruptions, which has no gap if the planned one has none. Interruptions for which a room has to be free
// are put off or left out while others use it.
std::vector<DayPart> interrupt(const InterruptionRules& rules, StepDraws& draws, const std::vector<PlannedEpisode>& day,
                               const PrivateRooms* rooms = nullptr);

}  // namespace fleet2d
