#include "meetings.hpp"

#include <algorithm>

namespace fleet2d {
namespace {

constexpr i64 ROUNDED = 8;  // more than all coordinates that a distance depends on are rounded by [lattice units]

std::size_t number_of(i64 i) { return static_cast<std::size_t>(i); }

void add_track(const TrackPiece& track, i64 begin, i64 end, Way& way) {
    const auto after = std::upper_bound(track.time.begin(), track.time.end(), begin);
    std::size_t i = number_of(std::max<i64>(0, after - track.time.begin() - 1));
    while (begin < end) {
        const Point at{track.x[i], track.y[i]};
        const bool is_last = i + 1 == track.time.size();
        const bool waits = track.time[i] > begin;  // before the first breakpoint it rests
        const i64 until = std::min(end, is_last ? end : waits ? track.time[i] : track.time[i + 1]);
        if (is_last || waits) {
            way.add({begin, until, 0, 0, at, 0, 0, track.away[i] != 0});
        } else {
            const i64 dx = track.x[i + 1] - at.x, dy = track.y[i + 1] - at.y;
            const i64 whole = dx == 0 && dy == 0 ? 0 : track.time[i + 1] - track.time[i];
            way.add({begin, until, track.time[i], whole, at, dx, dy, track.away[i] != 0});
        }
        begin = until;
        while (i + 1 < track.time.size() && track.time[i + 1] <= begin) ++i;
    }
}

void add_walk(Timelines& timelines, i64 body, i64 first, i64 end, Way& way) {
    const i64 step_us = timelines.step_us();
    BodyPose at = timelines.pose(body, first);
    for (i64 step = first; step < end; ++step) {
        const BodyPose next = timelines.pose(body, step + 1);
        const i64 dx = next.x - at.x, dy = next.y - at.y;
        const i64 begin = step * step_us;
        const i64 whole = dx == 0 && dy == 0 ? 0 : step_us;
        way.add({begin, begin + step_us, begin, whole, {at.x, at.y}, dx, dy, at.away != 0});
        at = next;
    }
}

Way way_of(Timelines& timelines, i64 body, i64 first, i64 end) {
    Way way;
    const auto& pieces = timelines.pieces(body);
    const auto after = std::upper_bound(pieces.begin(), pieces.end(), first,
                                        [](i64 step, const Piece& piece) { return step < piece.first; });
    for (std::size_t k = after == pieces.begin() ? 0 : number_of(after - pieces.begin() - 1); k < pieces.size(); ++k) {
        const i64 from = std::max(first, pieces[k].first);
        const i64 until = k + 1 < pieces.size() ? std::min(end, pieces[k + 1].first) : end;
        if (from >= until) continue;
        if (pieces[k].walk) {
            add_walk(timelines, body, from, until, way);
        } else {
            add_track(*pieces[k].track, from * timelines.step_us(), until * timelines.step_us(), way);
        }
    }
    return way;
}

struct MeetingLimits {
    i64 near, hard;
    MotionCounts counts;
};

// Whether two bodies meet between two moments within one stretch of each.
bool do_meet(const Straight& body, const Straight& other, i64 begin, i64 end, const MeetingLimits& limits) {
    const Point a0 = body.where(begin), a1 = body.where(end), b0 = other.where(begin), b1 = other.where(end);
    const i64 px = b0.x - a0.x, py = b0.y - a0.y;
    const i64 own_x = a1.x - a0.x, own_y = a1.y - a0.y;
    const i64 dx = b1.x - b0.x - own_x, dy = b1.y - b0.y - own_y;
    const i64 parting = px * dx + py * dy;
    if (limits.counts != OWN_MOTION && px * px + py * py < limits.hard * limits.hard && parting <= 0) return true;
    if (parting >= 0) return false;
    if (limits.counts != ALL_MOTION) {
        const bool mine = limits.counts == OWN_MOTION;
        const i64 vx = mine ? own_x : -dx - own_x, vy = mine ? own_y : -dy - own_y;  // towards the other one
        const i64 towards = px * vx + py * vy, then = (px + dx) * vx + (py + dy) * vy;
        if (towards <= 0 && then <= 0) return false;
    }
    const i64 way = dx * dx + dy * dy;
    const f64 near = static_cast<f64>(limits.near) * static_cast<f64>(limits.near);
    if (-parting >= way) {
        const f64 last_x = static_cast<f64>(px + dx), last_y = static_cast<f64>(py + dy);
        return last_x * last_x + last_y * last_y < near;
    }
    const f64 beside = static_cast<f64>(px * dy - py * dx);
    return beside * beside < near * static_cast<f64>(way);
}

// Whether two bodies are surely farther apart between two moments than their limits, whatever is rounded.
bool is_far(const Straight& body, const Straight& other, i64 begin, i64 end, i64 limit) {
    const Point a0 = body.where(begin), a1 = body.where(end), b0 = other.where(begin), b1 = other.where(end);
    const i64 px = b0.x - a0.x, py = b0.y - a0.y, qx = b1.x - a1.x, qy = b1.y - a1.y;
    const i64 reach = limit + ROUNDED;
    return (px > reach && qx > reach) || (px < -reach && qx < -reach) || (py > reach && qy > reach) ||
           (py < -reach && qy < -reach);
}

// The first step in which two bodies meet, -1 for none. Each step is looked at by itself, as what is rounded must not
// depend on where the ways begin.
i64 first_meeting_step(const Way& body, const Way& other, const MeetingLimits& limits, i64 first_us, i64 end_us,
                       i64 step_us) {
    const i64 limit = std::max(limits.near, limits.hard);
    if (!body.is_near(other, limit)) return -1;
    auto a = body.from(first_us);
    auto b = other.from(first_us);
    while (a != body.straights.end() && b != other.straights.end()) {
        const i64 begin = std::max({a->begin, b->begin, first_us}), end = std::min({a->end, b->end, end_us});
        if (begin >= end_us) return -1;
        const bool counts = begin < end && !a->away && !b->away && !is_far(*a, *b, begin, end, limit);
        const bool rest = a->whole == 0 && b->whole == 0;
        for (i64 from = begin; counts && from < end;) {
            const i64 until = rest ? end : std::min(end, (floor_div(from, step_us) + 1) * step_us);
            if (do_meet(*a, *b, from, until, limits)) return floor_div(from, step_us);
            from = until;
        }
        const i64 next = std::min(a->end, b->end);
        if (a->end == next) ++a;
        if (b->end == next) ++b;
    }
    return -1;
}

// The first meeting of a body that is due, where `first_step` returns the first step in which it meets another one.
template <class FirstStep>
std::optional<Meeting> first_meeting(i64 row, i64 number, const Distances& distances, i64 first, i64 end,
                                     const FirstStep& first_step) {
    std::optional<Meeting> best;
    for (i64 other = 0; other < distances.lead.shape[1]; ++other) {
        const i64 lead = distances.lead(number, other);
        if (other == row || lead < 0) continue;
        const MeetingLimits limits{distances.near(number, other), distances.hard(number, other),
                                   static_cast<MotionCounts>(distances.counts(number, other))};
        const i64 step = first_step(other, limits);
        if (step < 0) continue;
        const i64 due = std::max(first, step - lead);
        if (due >= end) continue;
        if (!best || due < best->due || (due == best->due && step < best->step)) best = Meeting{row, due, step, other};
    }
    return best;
}

i64 longest_lead(const Distances& distances) {
    i64 longest = 0;
    for (i64 i = 0; i < distances.lead.shape[0]; ++i) {
        for (i64 j = 0; j < distances.lead.shape[1]; ++j) longest = std::max(longest, distances.lead(i, j));
    }
    return longest;
}

}  // namespace

void KnownWays::update(Timelines& timelines, i64 first, i64 end) {
    const bool is_same = first == first_ && end == end_;
    first_ = first, end_ = end, step_us_ = timelines.step_us();
    ways_.resize(number_of(timelines.bodies()));
    changes_.resize(ways_.size(), -1);
    for (i64 body = 0; body < timelines.bodies(); ++body) {
        const std::size_t i = number_of(body);
        if (is_same && changes_[i] == timelines.changes(body)) continue;
        ways_[i] = fleet2d::way_of(timelines, body, first, end);
        changes_[i] = timelines.changes(body);
    }
}

std::optional<Meeting> KnownWays::meeting(i64 row, const TrackPiece& track, const Distances& distances) const {
    const i64 first_us = first_ * step_us_, end_us = end_ * step_us_;
    Way way;
    add_track(track, first_us, end_us, way);
    return first_meeting(row, 0, distances, first_, end_, [&](i64 other, const MeetingLimits& limits) {
        return first_meeting_step(way, ways_[number_of(other)], limits, first_us, end_us, step_us_);
    });
}

const Way& MeetingSearch::way_of(Timelines& timelines, i64 body, i64 first, i64 end) {
    KnownWay& known = ways_[number_of(body)];
    const i64 changes = timelines.changes(body);
    if (known.changes != changes || first < known.first || end > known.end) {
        known = {changes, first, end, fleet2d::way_of(timelines, body, first, end)};
    }
    return known.way;
}

i64 MeetingSearch::first_step(Timelines& timelines, i64 row, i64 other, const KnownMeeting& wanted) {
    auto& [known, before] = known_[number_of(row * timelines.bodies() + other)];
    if (!known.has_limits_of(wanted)) std::swap(known, before);
    const bool is_same = known.changes == wanted.changes && known.other_changes == wanted.other_changes &&
                         known.has_limits_of(wanted) && known.first <= wanted.first;
    if (is_same && known.step >= wanted.first) return known.step < wanted.end ? known.step : -1;
    if (is_same && known.step < 0 && wanted.end <= known.end) return -1;
    const bool goes_on = is_same && known.step < 0 && wanted.first <= known.end;
    const i64 from = goes_on ? known.end : wanted.first, step_us = timelines.step_us();
    const MeetingLimits limits{wanted.near, wanted.hard, static_cast<MotionCounts>(wanted.counts)};
    const Way& way = way_of(timelines, row, from, wanted.end);
    known = wanted;
    known.step = first_meeting_step(way, way_of(timelines, other, from, wanted.end), limits, from * step_us,
                                    wanted.end * step_us, step_us);
    return known.step;
}

std::vector<Meeting> MeetingSearch::run(Timelines& timelines, View<const i64> rows, const Distances& distances,
                                        i64 first, i64 end) {
    ways_.resize(number_of(timelines.bodies()));
    known_.resize(ways_.size() * ways_.size());
    const i64 until = end + longest_lead(distances);
    std::vector<Meeting> result;
    for (i64 number = 0; number < rows.size(); ++number) {
        const i64 row = rows[number];
        const auto found =
            first_meeting(row, number, distances, first, end, [&](i64 other, const MeetingLimits& limits) {
                return first_step(timelines, row, other,
                                  {timelines.changes(row), timelines.changes(other), limits.near, limits.hard,
                                   limits.counts, first, until, -1});
            });
        if (found) result.push_back(*found);
    }
    return result;
}

}  // namespace fleet2d
