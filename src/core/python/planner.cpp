#include "../planner.hpp"

#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "laws.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

constexpr i64 NEVER = i64{1} << 41;   // s
constexpr i64 LATEST = i64{1} << 20;  // s since midnight

using Numbers = std::vector<i64>;
using JobRow = std::tuple<i64, std::optional<LawRow>, LawRow, i64, Numbers, i64, bool, i64>;
using PastimeRow = std::tuple<i64, i64, LawRow, i64, i64>;
using DoingRow = std::tuple<i64, i64, i64, i64>;

// A plan as the core has it, and what it was made of.
struct OwnedPlan {
    DayPlan plan;
    std::tuple<LawRow, i64, std::vector<JobRow>, std::vector<PastimeRow>, i64, i64> made_of;
};

Job job_of(const JobRow& row, i64 number) {
    const auto& [activity, starts, takes, until, after, chance, needed, place] = row;
    require(-NEVER < until && until < NEVER, "jobs must end within 2**41 s");
    for (const i64 before : after) require(0 <= before && before < number, "jobs must come after earlier ones");
    Job job{activity, std::nullopt, law_of(takes), until, after, chance, needed, place};
    require(job.takes.shortest >= 0, "jobs must take 0 s or more");
    if (starts) job.starts = law_of(*starts);
    return job;
}

Pastime pastime_of(const PastimeRow& row) {
    const auto& [activity, weight, takes, first, last] = row;
    require(0 < weight && weight < MOST_DRAWN, "weights must be 1 to 2**31 - 1");
    Pastime pastime{activity, weight, law_of(takes), first, last};
    require(pastime.takes.shortest > 0, "pastimes must take 1 s or more");
    return pastime;
}

OwnedPlan plan_of(LawRow sleep, i64 least_sleep, std::vector<JobRow> jobs, std::vector<PastimeRow> pastimes, i64 rest,
                  i64 asleep) {
    DayPlan plan{law_of(sleep), least_sleep, {}, {}, rest, asleep};
    require(0 <= least_sleep && is_time(least_sleep), "least_sleep must be 0 to 2**36 s");
    require(static_cast<i64>(jobs.size()) < LATEST, "jobs must be fewer than 2**20");
    for (const JobRow& row : jobs) plan.jobs.push_back(job_of(row, static_cast<i64>(plan.jobs.size())));
    i64 weights = 0;
    for (const PastimeRow& row : pastimes) {
        plan.pastimes.push_back(pastime_of(row));
        weights += plan.pastimes.back().weight;
        require(weights < MOST_DRAWN, "the sum of all weights must be below 2**31");
    }
    return {std::move(plan), {std::move(sleep), least_sleep, std::move(jobs), std::move(pastimes), rest, asleep}};
}

}  // namespace

void bind_planner(nb::module_& m) {
    nb::class_<OwnedPlan>(m, "DayPlanner", R"(Draws days of a template; times in seconds since midnight.

A law is its quantiles, its least and largest value, and the positions of these among the quantiles.

Args:
    sleep: The law of going to bed.
    least_sleep: The least duration of sleep.
    jobs: Of each the activity, the law of its beginning, or None, and of its duration; its latest end; the jobs before
        it; its chance per million; whether it is needed; -1 on waking, 1 before bed, else 0.
    pastimes: Of each the activity, the weight, the law of its duration, and from when to when it may begin.
    rest: The activity without any.
    asleep: The activity that is sleep.)")
        .def(
            "__init__",
            [](OwnedPlan* self, LawRow sleep, i64 least_sleep, std::vector<JobRow> jobs,
               std::vector<PastimeRow> pastimes, i64 rest, i64 asleep) {
                new (self) OwnedPlan(
                    plan_of(std::move(sleep), least_sleep, std::move(jobs), std::move(pastimes), rest, asleep));
            },
            "sleep"_a, "least_sleep"_a, "jobs"_a, "pastimes"_a, "rest"_a, "asleep"_a)
        .def(
            "plan",
            [](const OwnedPlan& self, StepDraws& draws, i64 wake, i64 next_wake) {
                require(-LATEST < wake && wake < LATEST && -LATEST < next_wake && next_wake < LATEST,
                        "a day must be within 2**20 s of midnight");
                std::vector<DoingRow> rows;
                for (const Doing& each : plan_day(self.plan, draws, wake, next_wake)) {
                    rows.emplace_back(each.activity, each.begin, each.end, each.job);
                }
                return rows;
            },
            "draws"_a, "wake"_a, "next_wake"_a,
            R"(Draw a day.

Args:
    draws: The day's draws.
    wake: When it begins.
    next_wake: When the next day begins.

Returns:
    Activity, begin, end, and number of the job, or -1, of each doing; none if the jobs fit in no order.)")
        .def("__getstate__", [](const OwnedPlan& self) { return self.made_of; })
        .def("__setstate__", [](OwnedPlan& self, decltype(OwnedPlan::made_of) state) {
            new (&self) OwnedPlan(std::apply(plan_of, std::move(state)));
        });
}

}  // namespace fleet2d
