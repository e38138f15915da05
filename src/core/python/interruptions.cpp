#include "../interruptions.hpp"

#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "distributions.hpp"
#include "random.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

constexpr i64 LONGEST_STEP = i64{1} << 40;  // s

using StepRow = std::tuple<i64, i64, Numbers>;
using Chances = std::tuple<i64, i64, i64, i64>;
using NeedRow = std::tuple<std::vector<StepRow>, Numbers, std::optional<Numbers>, Chances, i64,
                           std::optional<std::pair<i64, i64>>, Numbers>;
using ErrandRow = std::tuple<StepRow, std::optional<Numbers>, std::optional<Numbers>>;
using EpisodeRow = std::tuple<i64, i64, i64, i64>;
using PartRow = std::tuple<i64, i64, i64, i64, i64, i64>;

// Rules as the core has them, and what they were made of.
struct OwnedRules {
    InterruptionRules rules;
    std::tuple<std::vector<NeedRow>, std::vector<ErrandRow>, Numbers, Numbers, i64, i64> made_of;
};

struct Reader {
    i64 activities;

    i64 activity(i64 number) const {
        require(0 <= number && number < activities, "there is no such activity");
        return number;
    }
    std::vector<bool> flags(const Numbers& numbers) const {
        std::vector<bool> result(static_cast<std::size_t>(activities), false);
        for (const i64 number : numbers) result[static_cast<std::size_t>(activity(number))] = true;
        return result;
    }
    std::optional<std::vector<bool>> flags(const std::optional<Numbers>& numbers) const {
        if (!numbers) return std::nullopt;
        return flags(*numbers);
    }
    static i64 chance(i64 number) {
        require(0 <= number && number <= CERTAIN, "chances must be 0 to 1024");
        return number;
    }
    static Quantiles quantiles(const Numbers& numbers) {
        require(numbers.size() == std::size_t{1} << QUANTILE_BITS, "quantiles must be 256");
        require(std::all_of(numbers.begin(), numbers.end(), [](i64 time) { return 1 <= time && time < LONGEST_STEP; }),
                "quantiles must be 1 to 2**40 s");
        return numbers;
    }
    InterruptionStep step(const StepRow& row) const {
        const auto& [number, chance_, takes] = row;
        return {activity(number), chance(chance_), quantiles(takes)};
    }
    Need need(const NeedRow& row) const {
        const auto& [steps, every, asleep, chances, patience, hours, met_by] = row;
        const auto [on_waking, before_bed, before_leaving, on_return] = chances;
        Need need{{},
                  quantiles(every),
                  std::nullopt,
                  chance(on_waking),
                  chance(before_bed),
                  chance(before_leaving),
                  chance(on_return),
                  patience,
                  std::nullopt,
                  flags(met_by)};
        for (const StepRow& each : steps) need.steps.push_back(step(each));
        if (asleep) need.asleep = quantiles(*asleep);
        if (hours) need.hours = {hours->first, hours->second};
        require(0 <= patience && patience < LONGEST_STEP, "patience must be 0 to 2**40 s");
        require(!hours || (0 <= hours->first && hours->first < LONGEST_STEP), "hours must begin at 0 to 2**40 s");
        return need;
    }
    Errand errand(const ErrandRow& row) const {
        const auto& [step_, after, before] = row;
        return {step(step_), flags(after), flags(before)};
    }
};

OwnedRules rules_of(std::vector<NeedRow> needs, std::vector<ErrandRow> errands, Numbers away, Numbers uninterruptible,
                    i64 sleep, i64 activities) {
    require(0 < activities && activities < i64{1} << 20, "activities must be 1 to 2**20");
    const Reader read{activities};
    InterruptionRules rules{{}, {}, read.flags(away), read.flags(uninterruptible), read.activity(sleep)};
    for (const NeedRow& row : needs) rules.needs.push_back(read.need(row));
    for (const ErrandRow& row : errands) rules.errands.push_back(read.errand(row));
    return {std::move(rules),
            {std::move(needs), std::move(errands), std::move(away), std::move(uninterruptible), sleep, activities}};
}

std::vector<PartRow> interrupted(const OwnedRules& self, StepDraws& draws, const std::vector<EpisodeRow>& day,
                                 const RoomUse* use, const std::vector<Numbers>& rooms) {
    require(!day.empty(), "a day must have an episode");
    require(!use || rooms.size() == self.rules.away.size(), "rooms must be those of each activity");
    std::vector<PlannedEpisode> planned;
    for (const auto& [activity, begin, end, room] : day) {
        require(0 <= activity && activity < static_cast<i64>(self.rules.away.size()), "there is no such activity");
        require(-LATEST_TIME < begin && begin <= end && end < LATEST_TIME,
                "episodes must be within 2**20 s of midnight, and end after they begin");
        planned.push_back({activity, begin, end, room});
    }
    const auto access = use ? std::optional<PrivateRooms>({*use, rooms}) : std::nullopt;
    std::vector<PartRow> rows;
    for (const DayPart& part : interrupt(self.rules, draws, planned, access ? &*access : nullptr)) {
        rows.emplace_back(part.planned, part.activity, part.begin, part.end, static_cast<i64>(part.role), part.room);
    }
    return rows;
}

}  // namespace

void bind_interruptions(nb::module_& m) {
    m.attr("CHANCE_BITS") = CHANCE_BITS;
    m.attr("QUANTILE_BITS") = QUANTILE_BITS;

    nb::enum_<Role>(m, "Role", "What a part of a day is.")
        .value("PLANNED", Role::PLANNED, "As planned.")
        .value("INTERRUPTS", Role::INTERRUPTS, "An interruption.")
        .value("RESUMES", Role::RESUMES, "What goes on after one.")
        .value("FINISHES", Role::FINISHES, "An interruption as the end of what it interrupts.");

    nb::class_<OwnedRules>(m, "Interruptions",
                           R"(Needs and errands of a person, as numbers: times in seconds, chances of 1024.

Args:
    needs: Of each the steps, each with its activity, chance, and 256 quantiles of its duration; 256 quantiles of the
        time to the next one, and in sleep, or None; its chances on waking, before bed, before leaving and on return;
        the patience; begin and length of its hours, or None; and the activities that meet it.
    errands: Of each its step, and the activities after and before which it is done; None: all.
    away: Activities out of the home.
    uninterruptible: Activities that needs don't interrupt.
    sleep: The activity that is sleep.
    activities: Number of activities.)")
        .def(
            "__init__",
            [](OwnedRules* self, std::vector<NeedRow> needs, std::vector<ErrandRow> errands, Numbers away,
               Numbers uninterruptible, i64 sleep, i64 activities) {
                new (self) OwnedRules(rules_of(std::move(needs), std::move(errands), std::move(away),
                                               std::move(uninterruptible), sleep, activities));
            },
            "needs"_a, "errands"_a, "away"_a, "uninterruptible"_a, "sleep"_a, "activities"_a)
        .def("interrupt", &interrupted, "draws"_a, "day"_a, "use"_a.none() = nb::none(),
             "rooms"_a = std::vector<Numbers>{},
             R"(Put interruptions into a day.

Args:
    draws: The draws of the day's interruptions.
    day: Activity, begin, end, and room, or -1, of each planned episode, without a gap.
    use: When others use private rooms; None: never.
    rooms: The rooms where each activity is done alone, the preferred one first; none: it isn't.

Returns:
    The number of the planned episode, -1 for an interruption; activity, begin, end, role and room of each part.)")
        .def("__getstate__", [](const OwnedRules& self) { return self.made_of; })
        .def("__setstate__", [](OwnedRules& self, decltype(OwnedRules::made_of) state) {
            new (&self) OwnedRules(std::apply(rules_of, std::move(state)));
        });
}

}  // namespace fleet2d
