#include "../planner.hpp"

#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "distributions.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

constexpr i64 LATEST_END = i64{1} << 41;  // s

using JobRow = std::tuple<i64, std::optional<DistributionRow>, DistributionRow, i64, Numbers, i64, bool, i64>;
using PastimeRow = std::tuple<i64, i64, DistributionRow, i64, i64>;
using PlannedRow = std::tuple<i64, i64, i64, i64, i64>;
using RoomLists = std::vector<Numbers>;

// A plan as the core has it, and what it was made of.
struct OwnedPlan {
    DayPlan plan;
    std::tuple<DistributionRow, i64, std::vector<JobRow>, std::vector<PastimeRow>, i64, i64> made_of;
};

Job job_of(const JobRow& row, i64 number) {
    const auto& [activity, starts, takes, until, after, chance, needed, place] = row;
    require(-LATEST_END < until && until < LATEST_END, "jobs must end within 2**41 s");
    for (const i64 before : after) require(0 <= before && before < number, "jobs must come after earlier ones");
    Job job{activity, std::nullopt, distribution_of(takes), until, after, chance, needed, place};
    require(job.takes.shortest >= 0, "jobs must take 0 s or more");
    if (starts) job.starts = distribution_of(*starts);
    return job;
}

Pastime pastime_of(const PastimeRow& row) {
    const auto& [activity, weight, takes, first, last] = row;
    require(0 < weight && weight < MAX_DRAWN, "weights must be 1 to 2**31 - 1");
    Pastime pastime{activity, weight, distribution_of(takes), first, last};
    // Else two of them could take turns forever without any time passing.
    require(pastime.takes.shortest >= 0 && (pastime.takes.shortest > 0 || pastime.takes.longest > 1),
            "pastimes must take 0 s or more, and not always less than 2 s if they may take 0 s");
    return pastime;
}

OwnedPlan plan_of(DistributionRow sleep, i64 min_sleep, std::vector<JobRow> jobs, std::vector<PastimeRow> pastimes,
                  i64 rest, i64 asleep) {
    DayPlan plan{distribution_of(sleep), min_sleep, {}, {}, rest, asleep};
    require(0 <= min_sleep && is_time(min_sleep), "min_sleep must be 0 to 2**36 s");
    require(static_cast<i64>(jobs.size()) < LATEST_TIME, "jobs must be fewer than 2**20");
    for (const JobRow& row : jobs) plan.jobs.push_back(job_of(row, static_cast<i64>(plan.jobs.size())));
    i64 weights = 0;
    for (const PastimeRow& row : pastimes) {
        plan.pastimes.push_back(pastime_of(row));
        weights += plan.pastimes.back().weight;
        require(weights < MAX_DRAWN, "the sum of all weights must be below 2**31");
    }
    return {std::move(plan), {std::move(sleep), min_sleep, std::move(jobs), std::move(pastimes), rest, asleep}};
}

void check_day(i64 wake, i64 next_wake) {
    require(-LATEST_TIME < wake && wake < LATEST_TIME && -LATEST_TIME < next_wake && next_wake < LATEST_TIME,
            "a day must be within 2**20 s of midnight");
}

}  // namespace

void bind_planner(nb::module_& m) {
    m.attr("ANY_ROOM") = ANY_ROOM;
    m.attr("NO_GAP_S") = NO_GAP_S;

    nb::class_<RoomUse>(m, "RoomUse", "When people use rooms that only one can use at a time; times in seconds.")
        .def(nb::init<>())
        .def(
            "add",
            [](RoomUse& self, i64 room, i64 begin, i64 end) {
                require(-LATEST_END < begin && begin <= end && end < LATEST_END,
                        "a use must end after it begins, within 2**41 s");
                self.add(room, begin, end);
            },
            "room"_a, "begin"_a, "end"_a, "Add a time in which somebody uses a room.")
        .def(
            "free",
            [](const RoomUse& self, const Numbers& rooms, i64 begin, i64 latest, i64 shortest,
               i64 end_by) -> std::optional<std::tuple<i64, i64, i64>> {
                require(
                    std::max({std::abs(begin), std::abs(latest), std::abs(shortest), std::abs(end_by)}) < LATEST_END,
                    "times must be within 2**41 s");
                const std::optional<FreeSlot> slot = self.free(rooms, begin, latest, shortest, end_by);
                if (!slot) return std::nullopt;
                return std::tuple(slot->begin, slot->end, slot->room);
            },
            "rooms"_a, "begin"_a, "latest"_a, "shortest"_a, "end_by"_a,
            R"(Return the first time at which one of some rooms is free for long enough.

Args:
    rooms: The rooms, the preferred one first.
    begin: The earliest beginning.
    latest: The latest beginning.
    shortest: The least duration.
    end_by: The latest end.

Returns:
    Begin, end and room; None if there is no such time.)");

    nb::class_<OwnedPlan>(m, "DayPlanner", R"(Draws days of a template; times in seconds since midnight.

A distribution is its quantiles, its least and largest value, and the positions of these among the quantiles.

Args:
    sleep: The distribution of going to bed.
    min_sleep: The minimum duration of sleep.
    jobs: Of each the activity, the distribution of its beginning, or None, and of its duration; its latest end; the jobs before
        it; its chance per million; whether it is needed; -1 on waking, 1 before bed, else 0.
    pastimes: Of each the activity, the weight, the distribution of its duration, and from when to when it may begin.
    rest: The activity without any.
    asleep: The activity that is sleep.)")
        .def(
            "__init__",
            [](OwnedPlan* self, DistributionRow sleep, i64 min_sleep, std::vector<JobRow> jobs,
               std::vector<PastimeRow> pastimes, i64 rest, i64 asleep) {
                new (self)
                    OwnedPlan(plan_of(std::move(sleep), min_sleep, std::move(jobs), std::move(pastimes), rest, asleep));
            },
            "sleep"_a, "min_sleep"_a, "jobs"_a, "pastimes"_a, "rest"_a, "asleep"_a)
        .def(
            "plan",
            [](const OwnedPlan& self, StepDraws& draws, i64 wake, i64 next_wake, const RoomUse* use,
               const RoomLists& rooms) {
                check_day(wake, next_wake);
                require(!use || rooms.size() == self.plan.jobs.size(), "rooms must be those of each job");
                const auto access = use ? std::optional<PrivateRooms>({*use, rooms}) : std::nullopt;
                std::vector<PlannedRow> rows;
                for (const Episode& each : plan_day(self.plan, draws, wake, next_wake, access ? &*access : nullptr)) {
                    rows.emplace_back(each.activity, each.begin, each.end, each.job, each.room);
                }
                return rows;
            },
            "draws"_a, "wake"_a, "next_wake"_a, "use"_a.none() = nb::none(), "rooms"_a = RoomLists{},
            R"(Draw a day.

Args:
    draws: The day's draws.
    wake: When it begins.
    next_wake: When the next day begins.
    use: When others use private rooms; None: never.
    rooms: The rooms where each job is done alone, the preferred one first; none: it isn't.

Returns:
    Activity, begin, end, number of the job, or -1, and room, or -1, of each episode; none if the jobs fit in no order.)")
        .def(
            "draw_order",
            [](const OwnedPlan& self, StepDraws& draws, const std::vector<bool>& chosen, i64 wake, i64 next_wake,
               bool by_deadline) {
                check_day(wake, next_wake);
                require(chosen.size() == self.plan.jobs.size(), "chosen must be of each job");
                const JobOrder order = draw_order(self.plan, draws, chosen, wake, next_wake, by_deadline);
                return std::tuple(order.jobs, order.latest, order.fits);
            },
            "draws"_a, "chosen"_a, "wake"_a, "next_wake"_a, "by_deadline"_a,
            R"(Draw an order of some jobs.

Args:
    draws: The draws.
    chosen: Whether each job is done.
    wake: When the day begins.
    next_wake: When the next day begins.
    by_deadline: Order them by their latest beginnings instead of the drawn ones.

Returns:
    The numbers of the jobs in order; the latest beginning of each, and of going to bed; and whether they fit.)")
        .def("__getstate__", [](const OwnedPlan& self) { return self.made_of; })
        .def("__setstate__", [](OwnedPlan& self, decltype(OwnedPlan::made_of) state) {
            new (&self) OwnedPlan(std::apply(plan_of, std::move(state)));
        });
}

}  // namespace fleet2d
