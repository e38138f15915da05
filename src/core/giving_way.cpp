#include "giving_way.hpp"

#include <algorithm>

#include "fields.hpp"
#include "grid.hpp"
#include "headings.hpp"

namespace fleet2d {
namespace {

constexpr i64 FIRST_ASIDE = 12;           // cells to each side at which it first looks for places
constexpr i64 STRAIGHT_STEP = 5;          // of `walking_distance`, to the side of a cell
constexpr i64 DIRECTIONS = 8;             // in which a body passes another one
constexpr std::size_t POINTS_BESIDE = 3;  // of those that are tried, after the nearest

std::size_t nth(i64 i) { return static_cast<std::size_t>(i); }

i64 length_of(const TrackPiece& track) { return static_cast<i64>(track.time.size()); }

Moment row_of(const TrackPiece& track, i64 i) {
    return {track.time[nth(i)], track.x[nth(i)], track.y[nth(i)], track.heading[nth(i)], track.away[nth(i)]};
}

bool is_same_pose(const Moment& a, const Moment& b) {
    return a.x == b.x && a.y == b.y && a.heading == b.heading && a.away == b.away;
}

TrackPiece track_of(const Legs& legs) {
    TrackPiece track;
    const auto copy = [&](std::size_t number, auto& column) {
        const auto values = legs.column<typename std::decay_t<decltype(column)>::value_type>(number);
        column.assign(values.data(), values.data() + values.size());
    };
    copy(0, track.time), copy(1, track.x), copy(2, track.y), copy(3, track.heading), copy(4, track.away);
    track.postures = {0};
    return track;
}

void stay_until(Legs& legs, Moment& now, i64 time) {
    if (time <= now.time) return;
    now.time = time;
    legs.mark(now);
}

// Add the breakpoints of a track from number `first` on, of which the body is at `now` what it would have been at
// `since`.
Delay go_on(Legs& legs, const Moment& now, const TrackPiece& track, i64 since, i64 first) {
    Delay delay{since, since, now.time - since, since};
    Moment last = now;
    last.time = since;
    for (i64 i = first; i < length_of(track); ++i) {
        const Moment row = row_of(track, i);
        delay.edge = last.time;
        if (is_same_pose(last, row) && row.time - last.time >= delay.later) break;
        delay.edge = row.time;
        last = row;
    }
    for (i64 i = first; i < length_of(track); ++i) {
        Moment row = row_of(track, i);
        row.time = delay.of(row.time);
        legs.mark(row);
    }
    return delay;
}

i64 heading_at(const TrackPiece& track, i64 stop, i64 moment) {
    const i64 begin = track.time[nth(stop)], end = track.time[nth(stop + 1)];
    const i64 turn = turn_between(track.heading[nth(stop)], track.heading[nth(stop + 1)]);
    return (track.heading[nth(stop)] + floor_div(turn * (moment - begin), std::max<i64>(end - begin, 1))) & (TURN - 1);
}

// The track that a body follows; none while it walks at random.
const TrackPiece* followed(const Timelines& timelines, i64 row) { return timelines.pieces(row).back().track.get(); }

Moment moment_of(Timelines& timelines, i64 row, i64 step) {
    const BodyPose pose = timelines.pose(row, step);
    return {step * timelines.step_us(), pose.x, pose.y, pose.heading, pose.away};
}

// Turn as at a stop of a track, and leave it as planned or, if it is late, at the next beat.
Moment rest_at(Legs& legs, const Moment& now, const TrackPiece& track, i64 stop, i64 since, const Yielder& body) {
    const i64 turn = turn_between(now.heading, heading_at(track, stop, since));
    Moment then = legs.turn(now, turn, body.turn_rate);
    stay_until(legs, then, std::max(since, next_multiple(then.time, body.beat)));
    return then;
}

i64 squared_distance_of(Point a, Point b) { return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y); }

// The points in the room of a body by which another one passes it, the nearest but one first.
std::vector<Point> points_beside(Timelines& timelines, i64 row, i64 step, const BodyInWay& in_way) {
    const BodyPose middle = timelines.pose(in_way.other, step), pose = timelines.pose(row, step);
    const auto room_of = [&](Point place) -> i64 {
        const GridCell cell{floor_div(place.y, SUB), floor_div(place.x, SUB)};
        return is_inside(in_way.room_of_place.shape, cell) ? at(in_way.room_of_place, cell) : -1;
    };
    const i64 room = room_of({middle.x, middle.y});
    std::vector<Point> points;
    for (i64 i = 0; i < DIRECTIONS; ++i) {
        const i64 heading = i * TURN / DIRECTIONS;
        const Point point{middle.x + floor_div(in_way.distance * cosine(heading), UNIT),
                          middle.y + floor_div(in_way.distance * sine(heading), UNIT)};
        if (room_of(point) == room && in_way.can_get(point)) points.push_back(point);
    }
    const auto away = [&](Point point) { return squared_distance_of(point, {pose.x, pose.y}); };
    std::ranges::stable_sort(points, {}, away);
    if (!points.empty()) points.erase(points.begin());
    if (points.size() > POINTS_BESIDE) points.resize(POINTS_BESIDE);
    return points;
}

// From a place to which a body stepped aside, go on with the first stop after a moment.
std::optional<Delay> come_back(Legs& legs, Moment now, const TrackPiece* track, const Yielder& body, i64 begin,
                               i64 met) {
    if (!track) return Delay{begin, begin, 0, begin};
    const i64 next = next_stop(*track, met, body.can_stand), last = length_of(*track) - 1;
    const i64 stop = next < 0 ? last : next;
    const Moment goal = row_of(*track, stop);
    if (next < 0 && !body.can_stand({goal.x, goal.y})) {  // it stood at a corner, to which no way leads
        stay_until(legs, now, goal.time);
        return Delay{begin, begin, 0, begin};
    }
    const auto there = body.go(legs, now, {goal.x, goal.y}, {});
    if (!there) return {};
    const i64 since = std::max(goal.time, begin);
    now = stop < last ? rest_at(legs, *there, *track, stop, since, body) : *there;
    Delay delay = go_on(legs, now, *track, since, stop + 1);
    delay.after = begin;
    return delay;
}

// Do at a place what a track does at its stop number `stop`, and go on from there with the stop after it; false if no
// way leads to that one.
bool go_on_beside(Detour& detour, Moment now, const TrackPiece& track, const Yielder& body, i64 begin, i64 since,
                  i64 stop) {
    const i64 size = length_of(track);
    i64 leaves = stop + 1;
    while (leaves < size && track.x[nth(leaves)] == track.x[nth(stop)] && track.y[nth(leaves)] == track.y[nth(stop)]) {
        ++leaves;
    }
    TrackPiece here = track;
    std::fill(here.x.begin() + stop, here.x.begin() + leaves, now.x);
    std::fill(here.y.begin() + stop, here.y.begin() + leaves, now.y);
    if (leaves == size) {
        detour.delays = {go_on(detour.legs, now, here, since, stop + 1)};
        detour.delays.front().after = begin;
        return true;
    }
    const i64 left = track.time[nth(leaves - 1)];
    const i64 after = next_stop(track, track.time[nth(leaves)] - 1, body.can_stand);
    const bool goes_away = std::any_of(track.away.begin() + stop, track.away.end(), [](u8 away) { return away != 0; });
    if (after < 0 || goes_away) return false;
    const Delay delay{begin, since, now.time - since, std::numeric_limits<i64>::max()};
    for (i64 i = stop + 1; i < leaves; ++i) {
        now = row_of(here, i);
        now.time = delay.of(std::max(now.time, since));
        detour.legs.mark(now);
    }
    const auto there = body.go(detour.legs, now, {track.x[nth(after)], track.y[nth(after)]}, {});
    if (!there) return false;
    const i64 arrives = track.time[nth(after)];
    const Moment next = rest_at(detour.legs, *there, track, after, arrives, body);
    detour.delays = {delay, go_on(detour.legs, next, track, arrives, after + 1)};
    detour.delays.back().after = left;
    return true;
}

}  // namespace

i64 next_stop(const TrackPiece& track, i64 moment, const std::function<bool(Point)>& can_stand) {
    const auto after = std::upper_bound(track.time.begin(), track.time.end(), moment);
    for (i64 i = std::max<i64>(after - track.time.begin() - 1, 0); i < length_of(track) - 1; ++i) {
        const Moment row = row_of(track, i), next = row_of(track, i + 1);
        if (row.x == next.x && row.y == next.y && next.time > moment && can_stand({row.x, row.y})) return i;
    }
    return -1;
}

std::optional<Detour> way_after_a_wait(Timelines& timelines, const KnownWays& ways, i64 row, i64 step,
                                       View<const i64> waits, const Distances& distances) {
    const Moment now = moment_of(timelines, row, step);
    const TrackPiece* track = followed(timelines, row);
    for (const i64 wait : waits) {
        Detour detour{{}, {{now.time, now.time, 0, now.time}}};
        Moment then = now;
        detour.legs.mark(now);
        stay_until(detour.legs, then, now.time + wait * timelines.step_us());
        if (track) {
            const auto after = std::upper_bound(track->time.begin(), track->time.end(), now.time);
            detour.delays = {go_on(detour.legs, then, *track, now.time, after - track->time.begin())};
        }
        if (!ways.meeting(row, track_of(detour.legs), distances)) return detour;
    }
    return {};
}

std::optional<Detour> way_by_a_place(Timelines& timelines, const KnownWays& ways, const Yielder& body, i64 step,
                                     i64 met, const std::vector<Point>& places, View<const i64> waits, i64 rests,
                                     const Distances& distances) {
    const i64 step_us = timelines.step_us();
    const Moment now = moment_of(timelines, body.row, step);
    const TrackPiece* track = followed(timelines, body.row);
    const auto is_free = [&](const Legs& legs) { return !ways.meeting(body.row, track_of(legs), distances); };
    for (const Point place : places) {
        Legs there;
        there.mark(now);
        const auto arrived = body.go(there, now, place, {});
        if (!arrived || (rests > 0 && !is_free(there))) continue;
        const i64 arrives = -floor_div(-arrived->time, step_us);
        const auto goes_on_after = [&](i64 wait) -> std::optional<Detour> {
            Detour detour{there, {}};
            Moment then = *arrived;
            stay_until(detour.legs, then, (arrives + wait) * step_us);
            const auto delay = come_back(detour.legs, then, track, body, now.time, (met + 1) * step_us);
            if (!delay) return {};
            detour.delays = {*delay};
            return detour;
        };
        for (const i64 wait : waits) {
            auto detour = goes_on_after(wait);
            if (detour && is_free(detour->legs)) return detour;
        }
        if (rests == 0) continue;
        if (auto detour = goes_on_after(rests)) return detour;
    }
    return {};
}

bool takes_stop(Timelines& timelines, const Yielder& body, i64 step, i64 met, i64 other, i64 near, i64 end) {
    if (!rests(timelines, other, step, end)) return false;
    const TrackPiece* track = followed(timelines, body.row);
    if (!track) return false;
    const i64 next = next_stop(*track, (met + 1) * timelines.step_us(), body.can_stand);
    const Moment stop = row_of(*track, next < 0 ? length_of(*track) - 1 : next);
    const BodyPose stands = timelines.pose(other, step);
    return squared_distance_of({stop.x, stop.y}, {stands.x, stands.y}) < near * near;
}

std::optional<Detour> way_past(Timelines& timelines, const KnownWays& ways, const Yielder& body, i64 step, i64 met,
                               const BodyInWay& in_way, View<const i64> waits, const Distances& distances, i64 end) {
    if (waits.size() > 0 && !rests(timelines, in_way.other, step, end)) {
        if (auto detour = way_after_a_wait(timelines, ways, body.row, step, waits, distances)) return detour;
    }
    if (takes_stop(timelines, body, step, met, in_way.other, in_way.near, end)) return {};
    constexpr i64 at_once[] = {0};
    return way_by_a_place(timelines, ways, body, step, met, points_beside(timelines, body.row, step, in_way),
                          {at_once, {1}}, 0, distances);
}

std::optional<Detour> way_round(Timelines& timelines, const Yielder& body, i64 step, i64 met,
                                const std::vector<Disc>& discs,
                                const std::function<std::optional<Point>(Point)>& beside) {
    const TrackPiece* track = followed(timelines, body.row);
    const i64 stop = track ? next_stop(*track, met, body.can_stand) : -1;
    if (stop < 0) return {};
    const Moment now = moment_of(timelines, body.row, step);
    std::optional<Point> goal = Point{track->x[nth(stop)], track->y[nth(stop)]};
    const bool is_free = std::ranges::all_of(discs, [&](const Disc& disc) { return disc.is_clear_of(*goal); });
    if (!is_free) goal = beside(*goal);
    if (!goal) return {};
    Detour detour;
    detour.legs.mark(now);
    const auto there = body.go(detour.legs, now, *goal, discs);
    if (!there) return {};
    const i64 since = std::max(track->time[nth(stop)], now.time);
    const Moment then = rest_at(detour.legs, *there, *track, stop, since, body);
    if (!is_free) {
        return go_on_beside(detour, then, *track, body, now.time, since, stop) ? std::optional(detour) : std::nullopt;
    }
    detour.delays = {go_on(detour.legs, then, *track, since, stop + 1)};
    detour.delays.front().after = now.time;
    return detour;
}

std::optional<Detour> way_from_here(Timelines& timelines, const Yielder& body, i64 step, i64 met,
                                    const std::function<bool(Point)>& may_stop) {
    const TrackPiece* track = followed(timelines, body.row);
    if (!track) return {};
    const i64 next = next_stop(*track, met, body.can_stand), last = length_of(*track) - 1;
    const i64 stop = next < 0 ? last : next;
    if (!may_stop({track->x[nth(stop)], track->y[nth(stop)]})) return {};
    Moment now = moment_of(timelines, body.row, step);
    const i64 begin = now.time, since = std::max(track->time[nth(stop)], begin);
    Detour detour;
    detour.legs.mark(now);
    if (stop < last) {
        now = rest_at(detour.legs, now, *track, stop, since, body);
    } else {
        stay_until(detour.legs, now, since);
    }
    return go_on_beside(detour, now, *track, body, begin, since, stop) ? std::optional(detour) : std::nullopt;
}

namespace {

// Cells to which a body can step aside from one, with their walking distances: every so many cells, so many to each
// side at most.
std::vector<std::pair<i32, GridCell>> cells_aside(const Cells& cells, GridCell here, i64 within, i64 spacing) {
    const auto shape = cells.part_of_cell.shape;
    const GridCell low{std::max<i64>(here.row - within, 0), std::max<i64>(here.column - within, 0)};
    const GridCell high{std::min(here.row + within + 1, shape[0]), std::min(here.column + within + 1, shape[1])};
    auto open =
        Array<bool, 2>::empty({std::max<i64>(high.row - low.row, 0), std::max<i64>(high.column - low.column, 0)});
    for (i64 r = low.row; r < high.row; ++r) {
        for (i64 c = low.column; c < high.column; ++c)
            open(r - low.row, c - low.column) = cells.part_of_cell(r, c) == cells.part;
    }
    const i64 goal[] = {here.row - low.row, here.column - low.column};
    const auto steps = walking_distance(open, {goal, {1, 2}});
    std::vector<std::pair<i32, GridCell>> found;
    const auto first_from = [&](i64 number) { return -floor_div(-number, spacing) * spacing; };
    for (i64 r = first_from(low.row); r < high.row; r += spacing) {
        for (i64 c = first_from(low.column); c < high.column; c += spacing) {
            const i32 away = steps.view()(r - low.row, c - low.column);
            if (away > 0) found.push_back({away, {r, c}});
        }
    }
    std::ranges::stable_sort(found, {}, [](const auto& place) { return place.first; });
    return found;
}

}  // namespace

std::vector<Point> places_aside(Timelines& timelines, i64 row, i64 step, i64 end, const Cells& cells, Point from,
                                const Search& search, View<const i64> reach) {
    const GridCell here{floor_div(from.y, SUB), floor_div(from.x, SUB)};
    std::vector<std::pair<Point, i64>> others;  // where somebody will be, and how near they may come
    for (i64 body = 0; body < timelines.bodies(); ++body) {
        if (body == row) continue;
        const OwnedWindow window = timelines.window(body, body + 1, step, end + 1);
        for (std::size_t run = 0; run < window.step.size(); ++run) {
            const std::pair other{Point{window.x[run], window.y[run]}, reach[body]};
            if (window.away[run] == 0 && (others.empty() || others.back() != other)) others.push_back(other);
        }
    }
    // Mostly there are enough places nearby.
    for (i64 within = std::min(search.within, FIRST_ASIDE);; within = std::min(2 * within, search.within)) {
        const bool is_last = within == search.within;
        std::vector<Point> places;
        for (const auto& [away, cell] : cells_aside(cells, here, within, search.spacing)) {
            if (static_cast<i64>(places.size()) == search.most) break;
            if (!is_last && away > within * STRAIGHT_STEP) break;  // a shorter way might lead outside
            const Point place{cell.column * SUB + CELL_CENTRE, cell.row * SUB + CELL_CENTRE};
            const bool is_clear = std::ranges::all_of(others, [&](const auto& other) {
                const i64 dx = place.x - other.first.x, dy = place.y - other.first.y;
                return dx * dx + dy * dy > other.second * other.second;
            });
            if (is_clear) places.push_back(place);
        }
        if (is_last || static_cast<i64>(places.size()) == search.most) return places;
    }
}

std::optional<Detour> way_aside(Timelines& timelines, const KnownWays& ways, const Yielder& body, i64 step, i64 met,
                                const AsideSearch& aside, View<const i64> waits, i64 rests,
                                const Distances& distances) {
    std::vector<Point> tried;
    const Point from = aside.from();
    for (const i64 within : {aside.near, aside.far}) {
        const Search search{within, aside.spacing, aside.most};
        auto places = places_aside(timelines, body.row, step, step + rests, aside.cells, from, search, aside.reach);
        if (within != aside.near && places == tried) break;
        if (auto detour = way_by_a_place(timelines, ways, body, step, met, places, waits, rests, distances)) {
            return detour;
        }
        tried = std::move(places);
    }
    return {};
}

std::vector<Disc> standing(Timelines& timelines, i64 row, i64 step, i64 steps, View<const i64> reach) {
    std::vector<Disc> discs;
    for (i64 body = 0; body < timelines.bodies(); ++body) {
        if (body == row) continue;
        for (const i64 at : {step, step + steps}) {
            if (!rests(timelines, body, at, at + steps)) continue;
            const BodyPose pose = timelines.pose(body, at);
            if (pose.away == 0) discs.push_back({{pose.x, pose.y}, reach[body]});
            break;
        }
    }
    return discs;
}

bool rests(Timelines& timelines, i64 body, i64 step, i64 end) {
    const OwnedWindow window = timelines.window(body, body + 1, step, end);
    const auto stays = [](const std::vector<i64>& values) {
        return std::ranges::all_of(values, [&](i64 value) { return value == values.front(); });
    };
    return stays(window.x) && stays(window.y);
}

}  // namespace fleet2d
