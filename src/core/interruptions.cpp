#include "interruptions.hpp"

#include <algorithm>

#include "lattice.hpp"

namespace fleet2d {
namespace {

constexpr i64 DAY = 86400;
constexpr i64 SHORTEST_REST = 60;  // of an activity after an interruption
constexpr i64 LAST_SLEEP = 1800;   // before waking, in which no need interrupts sleep
constexpr std::size_t MOST = 480;  // parts of a day

class InterruptedDay {
public:
    InterruptedDay(const InterruptionRules& rules, StepDraws& draws, const std::vector<PlannedEpisode>& day,
                   const PrivateRooms* rooms)
        : rules_(rules), draws_(draws), rooms_(rooms), waited_(rules.needs.size(), false) {
        for (const Need& need : rules.needs) due_.push_back(day.front().begin + draw_part(need.every));
        for (std::size_t k = 0; k < day.size(); ++k) {
            number_ = static_cast<i64>(k);
            episode_ = day[k];
            now_ = episode_.begin;
            fresh_ = true;
            const i64 before = k > 0 ? day[k - 1].activity : rules.sleep;
            const i64 after = k + 1 < day.size() ? day[k + 1].activity : rules.sleep;
            if (is_away(episode_.activity)) {
                skip_needs();
            } else if (episode_.activity == rules.sleep) {
                interrupt_sleep(before);
            } else {
                interrupt_activity(before, after);
            }
            if (now_ == episode_.begin || now_ < episode_.end) {
                go_on(episode_.end);
            } else {
                mark_finishing();
            }
        }
    }

    std::vector<DayPart> result;

private:
    bool is_away(i64 activity) const { return rules_.away[at(activity)]; }
    static std::size_t at(i64 activity) { return static_cast<std::size_t>(activity); }

    i64 take(u64 count) { return bits_.take(draws_, count); }
    bool happens(i64 chance) { return chance > 0 && (chance >= CERTAIN || take(CHANCE_BITS) < chance); }
    i64 draw_time(const Quantiles& quantiles) { return quantiles[static_cast<std::size_t>(take(QUANTILE_BITS))]; }
    i64 draw_part(const Quantiles& quantiles) {
        const i64 time = draw_time(quantiles);
        return (time * take(QUANTILE_BITS)) >> QUANTILE_BITS;
    }

    // The last interruptions are the end of their activity, which isn't resumed.
    void mark_finishing() {
        for (auto part = result.rbegin(); part != result.rend() && part->role == Role::INTERRUPTS; ++part) {
            part->role = Role::FINISHES;
        }
    }

    // Needs that occur out of the home are met there.
    void skip_needs() {
        for (std::size_t i = 0; i < due_.size(); ++i) {
            if (due_[i] < episode_.end) due_[i] = episode_.end + draw_part(rules_.needs[i].every);
        }
    }

    void interrupt_sleep(i64 before) {
        if (before != rules_.sleep) {
            do_errands(before);
            for (std::size_t i = 0; i < due_.size(); ++i) {
                if (happens(rules_.needs[i].before_bed)) meet(i, now_);
            }
        }
        for (std::size_t i = 0; i < due_.size(); ++i) {
            const Need& need = rules_.needs[i];
            due_[i] = std::max(due_[i], episode_.end);
            if (!need.asleep) continue;
            i64 time = now_ + draw_time(*need.asleep);
            while (time < episode_.end - LAST_SLEEP) {
                meet(i, time);
                time = std::max(time, now_) + draw_time(*need.asleep);
            }
            due_[i] = episode_.end + draw_part(need.every);
        }
    }

    void interrupt_activity(i64 before, i64 after) {
        if (before != episode_.activity && before != rules_.sleep) do_errands(before);
        const bool wakes = before == rules_.sleep, begins_anew = wakes || is_away(before);
        for (std::size_t i = 0; i < due_.size(); ++i) {
            const Need& need = rules_.needs[i];
            if (begins_anew && happens(wakes ? need.on_waking : need.on_return)) meet(i, now_);
            if (need.met_by[at(episode_.activity)]) due_[i] = episode_.end + draw_time(need.every);
        }
        meet_due_needs(after);
        if (!is_away(after)) return;
        for (std::size_t i = 0; i < due_.size(); ++i) {
            if (happens(rules_.needs[i].before_leaving)) meet(i, episode_.end);
        }
    }

    // Meet the needs that are due before the activity ends, or put them off until its end.
    void meet_due_needs(i64 after) {
        while (!due_.empty()) {
            const auto first = std::min_element(due_.begin(), due_.end());
            const auto i = static_cast<std::size_t>(first - due_.begin());
            const i64 time = std::max(*first, now_);
            if (time >= episode_.end) return;
            const bool waits = rules_.uninterruptible[at(episode_.activity)] ||
                               (!waited_[i] && episode_.end - time <= rules_.needs[i].patience);
            if (waits && !is_away(after)) {
                due_[i] = episode_.end;
                waited_[i] = true;
            } else {
                meet(i, waits ? episode_.end : time);
            }
        }
    }

    void do_errands(i64 before) {
        for (const Errand& errand : rules_.errands) {
            const bool fits = (!errand.after || (*errand.after)[at(before)]) &&
                              (!errand.before || (*errand.before)[at(episode_.activity)]);
            if (!fits || !happens(errand.step.chance)) continue;
            insert({{&errand.step, draw_time(errand.step.takes)}}, now_);
        }
    }

    // Meet a need at a time, or shortly before the end of the activity, if there is time.
    void meet(std::size_t number, i64 time) {
        const Need& need = rules_.needs[number];
        due_[number] = std::max(time, now_) + draw_time(need.every);
        waited_[number] = false;
        if (need.hours && floor_mod(time - need.hours->begin, DAY) > need.hours->length) return;
        std::vector<Timed> steps;
        for (const InterruptionStep& step : need.steps) {
            if (step.activity == episode_.activity || !happens(step.chance)) continue;
            steps.push_back({&step, draw_time(step.takes)});
        }
        if (!steps.empty() && !insert(steps, time)) due_[number] = episode_.end;
    }

    struct Timed {
        const InterruptionStep* step;
        i64 takes;
    };

    // Put steps into the activity at about a time; returns whether there is room for them.
    bool insert(const std::vector<Timed>& steps, i64 time) {
        i64 latest = episode_.end;
        for (const Timed& step : steps) latest -= step.takes;
        if (latest < episode_.end && latest >= time && time > latest - SHORTEST_REST) time = latest;
        time = std::min(time, latest);
        if (latest < now_ + (fresh_ ? SHORTEST_REST : 0) || result.size() + 2 * steps.size() > MOST) return false;
        i64 room = ANY_ROOM;
        const auto is_private = [&](const Timed& step) { return !private_rooms(step.step->activity).empty(); };
        if (const auto first = std::find_if(steps.begin(), steps.end(), is_private); first != steps.end()) {
            const std::optional<FreeSlot> slot =
                free_slot(private_rooms(first->step->activity), time, latest, episode_.end - latest);
            if (!slot) return false;
            time = slot->begin;
            room = slot->room;
        }
        if (time > now_) go_on(time);
        for (const Timed& step : steps) {
            result.push_back({-1, step.step->activity, time, time + step.takes, Role::INTERRUPTS, room});
            time += step.takes;
        }
        now_ = time;
        return true;
    }

    // The rooms where an activity is done alone; none: it isn't.
    const std::vector<i64>& private_rooms(i64 activity) const {
        static const std::vector<i64> NONE;
        return rooms_ ? rooms_->rooms[at(activity)] : NONE;
    }

    // When one of the rooms is free: at once, if the person is already alone in it.
    std::optional<FreeSlot> free_slot(const std::vector<i64>& rooms, i64 time, i64 latest, i64 takes) const {
        const bool is_alone = !private_rooms(episode_.activity).empty();
        if (is_alone && std::find(rooms.begin(), rooms.end(), episode_.room) != rooms.end()) {
            return FreeSlot{time, episode_.end, episode_.room};
        }
        return rooms_->use.free(rooms, time, latest, takes, episode_.end);
    }

    // Add the planned episode up to a time.
    void go_on(i64 until) {
        result.push_back(
            {number_, episode_.activity, now_, until, fresh_ ? Role::PLANNED : Role::RESUMES, episode_.room});
        now_ = until;
        fresh_ = false;
    }

    const InterruptionRules& rules_;
    StepDraws& draws_;
    const PrivateRooms* rooms_;
    Bits bits_;
    std::vector<i64> due_;      // when each need occurs next
    std::vector<bool> waited_;  // whether each need has waited for the end of an activity since it was due
    PlannedEpisode episode_{};  // to which interruptions are added
    i64 number_ = 0;            // its number
    i64 now_ = 0;               // the end of its last part so far
    bool fresh_ = true;         // whether no interruption was added to it so far
};

}  // namespace

std::vector<DayPart> interrupt(const InterruptionRules& rules, StepDraws& draws, const std::vector<PlannedEpisode>& day,
                               const PrivateRooms* rooms) {
    return std::move(InterruptedDay(rules, draws, day, rooms).result);
}

}  // namespace fleet2d
