#include "planner.hpp"

#include <algorithm>
#include <limits>
#include <tuple>

namespace fleet2d {
namespace {

constexpr i64 MILLION = 1'000'000;
constexpr int ORDERS = 5;  // drawn before a job is left out
constexpr i64 UNBOUNDED = std::numeric_limits<i64>::max();

class Planner {
public:
    Planner(const DayPlan& plan, StepDraws& draws, std::vector<bool> chosen, i64 wake, i64 next_wake)
        : plan_(plan), draws_(draws), chosen_(std::move(chosen)), wake_(wake), next_wake_(next_wake) {}

    std::vector<Episode> day;

    // Draw jobs and their order until they fit; returns whether they do.
    bool run(const PrivateRooms* rooms) {
        for (int tries = 1;; ++tries) {
            const JobOrder order = draw_order(tries % ORDERS == 0);
            if (order.fits) {
                fill_day(order, rooms);
                return true;
            }
            if (tries % ORDERS == 0 && !leave_out()) return false;
        }
    }

    JobOrder draw_order(bool by_deadline) {
        struct Draft {
            bool drawn = false;
            i64 preferred = 0, part = 0, rank = 0;
        };
        std::vector<Draft> drafts(plan_.jobs.size());
        const i64 latest_bed = std::min(plan_.sleep.longest, next_wake_ - plan_.min_sleep);
        const i64 bed = plan_.sleep.draw(draws_, latest_bed);
        JobOrder order;
        for (std::size_t i = 0; i < drafts.size(); ++i) {
            const Job& own = job(i);
            const auto is_drawn = [&](i64 k) { return drafts[static_cast<std::size_t>(k)].drawn; };
            const bool comes_after = std::any_of(own.after.begin(), own.after.end(), is_drawn);
            if (!chosen_[i] || (own.follows() && !comes_after)) continue;
            Draft draft{true, wake_, own.place, 0};
            if (own.starts) {
                draft.preferred = own.starts->draw(draws_, UNBOUNDED);
            } else if (own.place > 0) {
                draft.preferred = bed - own.takes.middle();
            } else if (comes_after) {
                draft.part = -1;
            }
            draft.rank = by_deadline && own.starts ? own.starts->longest : draft.preferred;
            for (const i64 k : own.after) {
                const Draft& before = drafts[static_cast<std::size_t>(k)];
                if (!before.drawn) continue;
                draft.preferred = std::max(draft.preferred, before.preferred);
                draft.part = std::max(draft.part, before.part);
                draft.rank = std::max(draft.rank, before.rank);
            }
            drafts[i] = draft;
            order.jobs.push_back(i);
        }
        std::sort(order.jobs.begin(), order.jobs.end(), [&](std::size_t a, std::size_t b) {
            return std::tie(drafts[a].part, drafts[a].rank, a) < std::tie(drafts[b].part, drafts[b].rank, b);
        });
        for (const std::size_t i : order.jobs) order.preferred.push_back(drafts[i].preferred);
        order.preferred.push_back(bed);
        order.latest = latest(order.jobs, latest_bed);
        order.fits = fits(order);
        return order;
    }

private:
    const Job& job(std::size_t number) const { return plan_.jobs[number]; }

    // Leave out the least probable job, of equal ones the last; returns whether there is one.
    bool leave_out() {
        std::size_t least = plan_.jobs.size();
        for (std::size_t i = 0; i < plan_.jobs.size(); ++i) {
            if (!chosen_[i] || job(i).needed) continue;
            if (least == plan_.jobs.size() || job(i).chance <= job(least).chance) least = i;
        }
        if (least == plan_.jobs.size()) return false;
        chosen_[least] = false;
        return true;
    }

    // The latest beginning of each job so that all later ones fit before `bed`, and `bed`.
    std::vector<i64> latest(const std::vector<std::size_t>& jobs, i64 bed) const {
        std::vector<i64> result(jobs.size() + 1, bed);
        for (std::size_t i = jobs.size(); i-- > 0;) {
            const Job& own = job(jobs[i]);
            result[i] = std::min(own.until, result[i + 1]) - own.takes.shortest;
            if (own.starts) result[i] = std::min(result[i], own.starts->longest);
        }
        return result;
    }

    bool fits(const JobOrder& order) const {
        i64 earliest = wake_;
        for (std::size_t i = 0; i < order.jobs.size(); ++i) {
            const Job& own = job(order.jobs[i]);
            if (own.starts) earliest = std::max(earliest, own.starts->shortest);
            if (earliest > order.latest[i]) return false;
            earliest += own.takes.shortest;
        }
        return std::max(earliest, plan_.sleep.shortest) <= order.latest.back();
    }

    void fill_day(const JobOrder& order, const PrivateRooms* rooms) {
        i64 now = wake_;
        for (std::size_t i = 0; i < order.jobs.size(); ++i) {
            const Job& own = job(order.jobs[i]);
            i64 begin = std::min(next_begin(own, now, order.preferred[i]), order.latest[i]);
            i64 end_by = std::min(own.until, order.latest[i + 1]), room = ANY_ROOM;
            if (rooms && !rooms->rooms[order.jobs[i]].empty()) {
                const std::optional<FreeSlot> slot =
                    rooms->use.free(rooms->rooms[order.jobs[i]], begin, order.latest[i], own.takes.shortest, end_by);
                if (!slot) continue;
                begin = slot->begin;
                end_by = slot->end;
                room = slot->room;
            }
            const i64 end = begin + own.takes.draw(draws_, end_by - begin);
            fill(now, begin);
            day.push_back({own.activity, begin, end, static_cast<i64>(order.jobs[i]), room});
            now = end;
        }
        i64 bed = std::min(std::max(now, order.preferred.back()), order.latest.back());
        if (bed - now < NO_GAP_S && now >= plan_.sleep.shortest) bed = now;
        fill(now, bed);
        day.push_back({plan_.asleep, bed, next_wake_, -1});
    }

    // When a job begins: at the preferred time, or `now` if that is a little earlier.
    static i64 next_begin(const Job& own, i64 now, i64 preferred) {
        const i64 begin = std::max(now, preferred);
        return begin - now < NO_GAP_S && (!own.starts || own.starts->shortest <= now) ? now : begin;
    }

    // Fill a time with pastimes, and with rest where no pastime fits.
    void fill(i64 begin, i64 end) {
        std::vector<const Pastime*> options;
        while (begin < end) {
            const i64 last = day.empty() ? -1 : day.back().activity;
            i64 weights = 0;
            options.clear();
            for (const Pastime& each : plan_.pastimes) {
                const bool fits = each.first <= begin && begin <= each.last && each.takes.shortest <= end - begin;
                if (!fits || each.activity == last) continue;
                options.push_back(&each);
                weights += each.weight;
            }
            if (options.empty()) {
                const i64 over = std::min(end, begin + NO_GAP_S);
                if (last == plan_.rest && day.back().job < 0) {
                    day.back().end = over;
                } else {
                    day.push_back({plan_.rest, begin, over, -1});
                }
                begin = over;
                continue;
            }
            i64 left = draws_.below(static_cast<u64>(weights));
            std::size_t i = 0;
            for (; left >= options[i]->weight; ++i) left -= options[i]->weight;
            const Pastime& own = *options[i];
            i64 over = begin + own.takes.draw(draws_, end - begin);
            if (end - over < NO_GAP_S && end - begin <= own.takes.longest) over = end;
            day.push_back({own.activity, begin, over, -1});
            begin = over;
        }
    }

    const DayPlan& plan_;
    StepDraws& draws_;
    std::vector<bool> chosen_;
    const i64 wake_, next_wake_;
};

}  // namespace

i64 Distribution::position(i64 value) const {
    const i64 i = std::upper_bound(knots.begin(), knots.end(), value) - knots.begin() - 1;
    const i64 top = static_cast<i64>(knots.size()) - 1;
    if (i < 0) return 0;
    if (i >= top) return top << BITS;
    const i64 below = knots[static_cast<std::size_t>(i)], above = knots[static_cast<std::size_t>(i) + 1];
    return (i << BITS) + ((value - below) << BITS) / (above - below);
}

i64 Distribution::draw(StepDraws& draws, i64 high) const {
    const i64 end = high >= longest ? last : position(high);
    high = std::min(high, longest);
    if (shortest >= high) return std::min(shortest, high);
    if (first >= end) return shortest >= knots.back() ? shortest : high;
    const i64 at = first + draws.below(static_cast<u64>(end - first));
    const auto i = static_cast<std::size_t>(at >> BITS);
    const i64 part = ((knots[i + 1] - knots[i]) * (at & ((i64{1} << BITS) - 1))) >> BITS;
    return std::min(std::max(knots[i] + part, shortest), high);
}

JobOrder draw_order(const DayPlan& plan, StepDraws& draws, const std::vector<bool>& chosen, i64 wake, i64 next_wake,
                    bool by_deadline) {
    return Planner(plan, draws, chosen, wake, next_wake).draw_order(by_deadline);
}

std::vector<Episode> plan_day(const DayPlan& plan, StepDraws& draws, i64 wake, i64 next_wake,
                              const PrivateRooms* rooms) {
    std::vector<bool> chosen;
    for (const Job& job : plan.jobs) chosen.push_back(draws.below(MILLION) < job.chance);
    Planner planner(plan, draws, std::move(chosen), wake, next_wake);
    return planner.run(rooms) ? std::move(planner.day) : std::vector<Episode>{};
}

}  // namespace fleet2d
