#include "timelines.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include "../grid.hpp"
#include "giving_way.hpp"
#include "legs.hpp"
#include "line_of_sight.hpp"
#include "mesh.hpp"
#include "motion.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<Distances> = 4;

namespace {

template <class T>
std::vector<T> copied(View<const T> values) {
    return {values.begin(), values.end()};
}

}  // namespace

TrackPiece piece_of(const Breakpoints& track) {
    const i64 count = track.size();
    require(count > 0 && track.x.size() == count && track.y.size() == count && track.heading.size() == count &&
                track.away.size() == count,
            "all arrays of a track must have one length, 1 or more");
    require(is_traceable(track), "a track's times must ascend, and its legs be short and its coordinates small");
    return {copied(track.time), copied(track.x), copied(track.y), copied(track.heading), copied(track.away), {}, {0}};
}

namespace {

constexpr i64 FAR = i64{1} << 29;            // where a random walk is, and its headings, are nearer to 0
constexpr i64 MOST_STANDING = i64{1} << 20;  // steps for which others stand: a random walk is drawn for so long
constexpr const char* NO_STATE = "this is no state of timelines";

// A part of a state that isn't an array.
template <class T>
T part(nb::handle source) {
    T value{};
    require(nb::try_cast(source, value), NO_STATE);
    return value;
}

// A part that is an array, and what had to be copied of it.
template <class T>
class ArrayPart {
public:
    explicit ArrayPart(nb::handle source) { require(border::view_of(source, view_, copy_), NO_STATE); }
    operator View<const T>() const { return view_; }

private:
    View<const T> view_;
    nb::object copy_;
};

// Timelines, and the meshes that their random walks need.
class OwnedTimelines {
public:
    OwnedTimelines(i64 bodies, i64 step_us) : timelines_(checked(bodies), step_us) {
        require(0 < step_us && step_us <= LATEST, "step_us must be 1 or more");
    }

    void follow(i64 body, i64 step, const Breakpoints& track, View<const i64> posture_us, View<const i8> postures) {
        check(body, step);
        require(postures.size() == posture_us.size() + 1, "postures must be one more than posture_us");
        bool ascend = true;
        for (i64 i = 1; i < posture_us.size(); ++i) ascend &= posture_us[i - 1] <= posture_us[i];
        require(ascend, "posture_us must ascend");
        auto piece = std::make_shared<TrackPiece>(piece_of(track));
        piece->posture_us = copied(posture_us);
        piece->postures = copied(postures);
        timelines_.put(body, {step, std::move(piece), nullptr});
    }

    void walk(i64 body, i64 step, nb::object walls, nb::object space, const WalkRule& rule,
              std::tuple<i64, i64, i64> start) {
        check(body, step);
        auto piece = std::make_shared<WalkPiece>();
        piece->walls = nb::cast<Mesh>(walls);
        piece->space = nb::cast<Mesh>(space);
        piece->rule = rule;
        check_walk(rule);
        piece->drawn_from = step;
        const auto [x, y, heading] = start;
        for (const i64 value : {x, y, heading}) {
            require(-FAR < value && value < FAR, "start must be within 2**29 of 0");
        }
        piece->x.push_back(static_cast<i32>(x));
        piece->y.push_back(static_cast<i32>(y));
        piece->heading.push_back(static_cast<i32>(heading));
        keep(walls);
        keep(space);
        timelines_.put(body, {step, nullptr, std::move(piece)});
    }

    std::tuple<i64, i64, i64, i64> pose(i64 body, i64 step) {
        check_known(body, step);
        const BodyPose pose = timelines_.pose(body, step);
        return {pose.x, pose.y, pose.heading, pose.away};
    }

    Array<i64, 3> poses(View<const i64> steps) {
        auto poses = Array<i64, 3>::empty({steps.size(), timelines_.bodies(), 4});
        const View<i64, 3> rows = poses;
        for (i64 i = 0; i < steps.size(); ++i) {
            for (i64 body = 0; body < timelines_.bodies(); ++body) {
                const auto [x, y, heading, away] = pose(body, steps[i]);
                i64 column = 0;
                for (const i64 value : {x, y, heading, away}) rows(i, body, column++) = value;
            }
        }
        return poses;
    }

    using Rows = std::vector<std::tuple<i64, i64, i64, i64>>;
    Rows meetings(View<const i64> rows, const Distances& distances, i64 first, i64 end) {
        check_meetings(rows.size(), distances, first, end);
        for (const i64 row : rows) check(row, first);
        Rows result;
        for (const auto& [row, due, step, other] : search_.run(timelines_, rows, distances, first, end)) {
            result.emplace_back(row, due, step, other);
        }
        return result;
    }

    std::tuple<i64, i64> meeting_on(i64 row, const Breakpoints& track, const Distances& distances, i64 first, i64 end) {
        check_meetings(1, distances, first, end);
        check(row, first);
        const auto found = known_ways(first, end).meeting(row, piece_of(track), distances);
        return found ? std::tuple(found->step, found->other) : std::tuple(i64{-1}, i64{-1});
    }

    std::tuple<i64, i64> meeting_at_rest(i64 row, const Distances& distances, i64 first, i64 end) {
        check_meetings(1, distances, first, end);
        check(row, first);
        const BodyPose at = timelines_.pose(row, first);
        const TrackPiece rest{{first * timelines_.step_us()}, {at.x}, {at.y}, {at.heading},
                              {static_cast<u8>(at.away)},     {},     {0}};
        const auto found = known_ways(first, end).meeting(row, rest, distances);
        return found ? std::tuple(found->step, found->other) : std::tuple(i64{-1}, i64{-1});
    }

    // Breakpoints from the present one on, the last of them, and how much later they continue the track.
    using DelayFields = std::tuple<i64, i64, i64, i64>;
    using DetourFields = std::optional<std::tuple<Legs, MomentRow, std::vector<DelayFields>>>;
    static DetourFields fields_of(std::optional<Detour> detour) {
        if (!detour) return {};
        std::vector<DelayFields> delays;
        for (const auto& [after, since, later, edge] : detour->delays) delays.emplace_back(after, since, later, edge);
        const MomentRow end = plain(detour->legs.last());
        return std::tuple(std::move(detour->legs), end, std::move(delays));
    }

    DetourFields way_after_a_wait(i64 row, i64 step, View<const i64> waits, const Distances& distances, i64 end) {
        check_detour(row, step, waits, distances, end);
        return fields_of(fleet2d::way_after_a_wait(timelines_, known_ways(step, end), row, step, waits, distances));
    }

    DetourFields way_by_a_place(const YielderFields& body, i64 step, i64 met, View<const i64, 2> places,
                                View<const i64> waits, i64 rests, const Distances& distances, i64 end) {
        const i64 row = std::get<0>(body);
        check_detour(row, step, waits, distances, end);
        check(row, met + 1);
        require(0 <= rests && rests < FAR, "rests must be 0 or more steps");
        require(places.shape[1] == 2 && all_in_range(places, -FARTHEST_POSE + 1, FARTHEST_POSE),
                "places must be (n, 2), within 2**29 of 0");
        const Yielder yielder = yielder_of(body);
        return fields_of(fleet2d::way_by_a_place(timelines_, known_ways(step, end), yielder, step, met,
                                                 points_of(places), waits, rests, distances));
    }

    DetourFields way_past(const YielderFields& body, i64 step, i64 met, const BodyInWayFields& in_way,
                          View<const i64> waits, const Distances& distances, i64 end) {
        const i64 row = std::get<0>(body);
        check_detour(row, step, waits, distances, end);
        check(row, met + 1);
        require(step < end, "end must be after step");
        check_known(std::get<0>(in_way), step);
        const Yielder yielder = yielder_of(body);
        return fields_of(fleet2d::way_past(timelines_, known_ways(step, end), yielder, step, met,
                                           body_in_way_of(in_way, std::get<1>(body)), waits, distances, end));
    }

    DetourFields way_aside(const YielderFields& body, i64 step, i64 met, const AsideSearchFields& aside,
                           View<const i64> waits, i64 rests, const Distances& distances, i64 end) {
        const i64 row = std::get<0>(body);
        check_detour(row, step, waits, distances, end);
        check(row, met + 1);
        require(0 <= rests && rests < FAR, "rests must be 0 or more steps");
        require(std::get<7>(aside).size() == timelines_.bodies(), "reach must be (bodies,)");
        for (i64 other = 0; other < timelines_.bodies(); ++other) {
            check_known(other, step);
            check(other, step + rests);
        }
        const Yielder yielder = yielder_of(body);
        return fields_of(fleet2d::way_aside(timelines_, known_ways(step, end), yielder, step, met,
                                            aside_search_of(aside), waits, rests, distances));
    }

    bool takes_stop(i64 row, const Mesh& space, i64 step, i64 met, i64 other, i64 near, i64 end) {
        require(step < end, "end must be after step");
        require(0 <= near && near < FAR, "near must be small");
        check_begin(row, step);
        check(row, met + 1);
        check_known(other, step);
        check(other, end);
        const auto can_stand = [&space](Point at) { return strictly_inside(space, at.x, at.y); };
        return fleet2d::takes_stop(timelines_, {row, 1.0, 1, {}, can_stand}, step, met, other, near, end);
    }

    DetourFields way_round(const YielderFields& body, i64 step, i64 met, View<const i64, 2> discs,
                           const nb::callable& beside) {
        check_begin(std::get<0>(body), step);
        const auto place = [&](Point goal) -> std::optional<Point> {
            const nb::object found = beside(goal.x, goal.y);
            if (found.is_none()) return {};
            std::pair<i64, i64> at;
            require(nb::try_cast(found, at), "beside must return x and y, or None");
            check_point(at.first, at.second);
            return Point{at.first, at.second};
        };
        return fields_of(fleet2d::way_round(timelines_, yielder_of(body), step, met, discs_of(discs), place));
    }

    DetourFields way_from_here(const YielderFields& body, i64 step, i64 met, const nb::callable& may_stop) {
        check_begin(std::get<0>(body), step);
        const auto may = [&](Point goal) { return nb::cast<bool>(may_stop(goal.x, goal.y)); };
        return fields_of(fleet2d::way_from_here(timelines_, yielder_of(body), step, met, may));
    }

    Array<i64, 2> places_aside(i64 row, i64 step, i64 end, View<const i32, 2> part_of_cell, i64 part,
                               std::pair<i64, i64> from, std::tuple<i64, i64, i64> search, View<const i64> reach) {
        require(step <= end && end - step <= FAR, "end must not be before step");
        require(reach.size() == timelines_.bodies() && all_in_range(reach, 0, FAR),
                "reach must be (bodies,), and small");
        check(row, step);
        for (i64 body = 0; body < timelines_.bodies(); ++body) {
            check_known(body, step);
            check(body, end);
        }
        const auto [within, spacing, most] = search;
        require(0 <= within && within < FAR && 0 < spacing && spacing < FAR, "within and spacing must be small");
        const Point at{from.first, from.second};
        require(is_inside(part_of_cell.shape, {floor_div(at.y, SUB), floor_div(at.x, SUB)}), "from must be in a cell");
        const auto places =
            fleet2d::places_aside(timelines_, row, step, end, {part_of_cell, part}, at, {within, spacing, most}, reach);
        return Array<i64, 2>::copy_of(rows_of(places));
    }

    Array<i64, 2> standing(i64 row, i64 step, i64 steps, View<const i64> reach) {
        require(0 < steps && steps <= MOST_STANDING, "steps must be from 1 to 2**20");
        require(reach.size() == timelines_.bodies() && all_in_range(reach, 0, FAR),
                "reach must be (bodies,), and small");
        for (i64 body = 0; body < timelines_.bodies(); ++body) {
            check_known(body, step);
            check(body, step + 2 * steps);
        }
        return rows_of(fleet2d::standing(timelines_, row, step, steps, reach));
    }

    bool rests(i64 body, i64 first, i64 end) {
        require(first < end, "end must be after first");
        check_known(body, first);
        check(body, end);
        return fleet2d::rests(timelines_, body, first, end);
    }

    OwnedWindow window(i64 first, i64 end) { return window_of(0, timelines_.bodies(), first, end); }
    OwnedWindow runs(i64 body, i64 first, i64 end) {
        check(body, first);
        return window_of(body, body + 1, first, end);
    }

    void forget(i64 before) {
        timelines_.forget(before);
        std::erase_if(meshes_, [this](const nb::object& mesh) { return !is_walked(nb::cast<Mesh>(mesh)); });
    }

    // A copy that shares tracks, which never change, and has its own random walks, which are drawn on.
    OwnedTimelines copy() const {
        OwnedTimelines twin(timelines_.bodies(), timelines_.step_us());
        for (i64 body = 0; body < timelines_.bodies(); ++body) {
            for (const auto& [first, track, walk] : timelines_.pieces(body)) {
                twin.timelines_.put(body, {first, track, walk ? std::make_shared<WalkPiece>(*walk) : nullptr});
            }
        }
        twin.meshes_ = meshes_;
        return twin;
    }

    nb::tuple state() const {
        nb::list bodies;
        for (i64 body = 0; body < timelines_.bodies(); ++body) {
            nb::list pieces;
            for (const Piece& piece : timelines_.pieces(body)) pieces.append(state_of(piece));
            bodies.append(pieces);
        }
        return nb::make_tuple(timelines_.bodies(), timelines_.step_us(), bodies);
    }

    void restore(const nb::list& bodies) {
        i64 body = 0;
        for (nb::handle pieces : bodies) {
            require(nb::isinstance<nb::list>(pieces), NO_STATE);
            for (nb::handle piece : nb::borrow<nb::list>(pieces)) {
                require(nb::isinstance<nb::tuple>(piece), NO_STATE);
                restore_piece(body, nb::borrow<nb::tuple>(piece));
            }
            ++body;
        }
    }

private:
    void check_detour(i64 row, i64 step, View<const i64> waits, const Distances& distances, i64 end) const {
        check_meetings(1, distances, step, end);
        check_begin(row, step);
        require(all_in_range(waits, 0, FAR), "waits must be 0 or more steps, and short");
    }
    void check_begin(i64 row, i64 step) const {
        check_known(row, step);
        require(timelines_.pieces(row).back().first <= step, "the body begins another motion later");
    }
    void check_meetings(i64 rows, const Distances& distances, i64 first, i64 end) const {
        require(first <= end && end - first <= FAR, "end must not be before first");
        const std::array<i64, 2> shape{rows, timelines_.bodies()};
        require(distances.lead.shape == shape && distances.near.shape == shape && distances.hard.shape == shape &&
                    distances.counts.shape == shape,
                "all distances must be (rows, bodies)");
        i64 longest = 0;
        for (i64 i = 0; i < rows; ++i) {
            for (i64 other = 0; other < timelines_.bodies(); ++other) {
                longest = std::max(longest, distances.lead(i, other));
                for (const i64 units : {distances.near(i, other), distances.hard(i, other)}) {
                    require(0 <= units && units < FAR, "distances must be 0 or more, and small");
                }
            }
        }
        require(longest < FAR, "leads must be small");
        for (i64 body = 0; body < timelines_.bodies(); ++body) {
            check_known(body, first);
            check(body, end + longest);
        }
    }
    static i64 checked(i64 bodies) {
        require(0 <= bodies && bodies < (i64{1} << 31), "bodies must be 0 or more");
        return bodies;
    }
    void check(i64 body, i64 step) const {
        require(0 <= body && body < timelines_.bodies(), "there is no such body");
        require(0 <= step && step <= LATEST / timelines_.step_us(),
                "step must be 0 or more, and its time at most 2**61 us");
    }
    void check_known(i64 body, i64 step) const {
        check(body, step);
        const auto& pieces = timelines_.pieces(body);
        require(!pieces.empty() && pieces.front().first <= step,
                "the step is forgotten, or the body has no motion yet");
        require(!pieces.front().walk || (pieces.size() > 1 && pieces[1].first <= step) ||
                    pieces.front().walk->drawn_from <= step,
                "the step is forgotten");
    }
    static void check_walk(const WalkRule& rule) {
        require(0 <= rule.stride && rule.stride < (i64{1} << 31), "stride must be in 0 to 2**31 - 1");
        require(0 <= rule.sway && rule.sway < (i64{1} << 52), "sway must be in 0 to 2**52 - 1");
        require(0 <= rule.turn_limit && rule.turn_limit < (i64{1} << 30), "turn_limit must be in 0 to 2**30 - 1");
    }
    OwnedWindow window_of(i64 first_body, i64 end_body, i64 first, i64 end) {
        require(first <= end, "end must not be before first");
        for (i64 body = first_body; body < end_body; ++body) {
            check_known(body, first);
            check(body, end);
        }
        return timelines_.window(first_body, end_body, first, end);
    }
    // Keep a mesh for as long as a body walks in it; most walks share theirs.
    void keep(nb::object mesh) {
        for (const nb::object& kept : meshes_) {
            if (kept.is(mesh)) return;
        }
        meshes_.push_back(std::move(mesh));
    }
    bool is_walked(const Mesh& mesh) const {
        for (i64 body = 0; body < timelines_.bodies(); ++body) {
            for (const Piece& piece : timelines_.pieces(body)) {
                if (piece.walk && (piece.walk->walls.vertices.data == mesh.vertices.data ||
                                   piece.walk->space.vertices.data == mesh.vertices.data)) {
                    return true;
                }
            }
        }
        return false;
    }
    nb::object mesh_of(const Mesh& mesh) const {
        for (const nb::object& kept : meshes_) {
            if (nb::cast<Mesh>(kept).vertices.data == mesh.vertices.data) return kept;
        }
        return nb::none();
    }
    nb::tuple state_of(const Piece& piece) const {
        if (piece.walk) {
            const WalkPiece& walk = *piece.walk;
            const auto rule =
                nb::make_tuple(walk.rule.key, walk.rule.stride, walk.rule.sway, walk.rule.turn_limit, walk.rule.stays);
            return nb::make_tuple(piece.first, mesh_of(walk.walls), mesh_of(walk.space), rule, walk.drawn_from,
                                  array_of(walk.x), array_of(walk.y), array_of(walk.heading));
        }
        const TrackPiece& track = *piece.track;
        const auto breakpoints = nb::make_tuple(array_of(track.time), array_of(track.x), array_of(track.y),
                                                array_of(track.heading), array_of(track.away));
        return nb::make_tuple(piece.first, breakpoints, array_of(track.posture_us), array_of(track.postures));
    }
    void restore_piece(i64 body, nb::tuple state) {
        const bool is_track = state.size() == 4;
        require(is_track || state.size() == 8, NO_STATE);
        const i64 first = part<i64>(state[0]);
        if (is_track) {
            const auto track = part<nb::tuple>(state[1]);
            require(track.size() == 5, NO_STATE);
            const ArrayPart<i64> time(track[0]), x(track[1]), y(track[2]), heading(track[3]), posture_us(state[2]);
            const ArrayPart<u8> away(track[4]);
            const ArrayPart<i8> postures(state[3]);
            follow(body, first, {time, x, y, heading, away}, posture_us, postures);
            return;
        }
        const auto [key, stride, sway, turn_limit, stays] = part<std::tuple<u64, i64, i64, i64, i64>>(state[3]);
        const i64 drawn_from = part<i64>(state[4]);
        const ArrayPart<i32> xs(state[5]), ys(state[6]), headings(state[7]);
        const View<const i32> x = xs, y = ys, heading = headings;
        require(x.size() > 0 && x.size() == y.size() && x.size() == heading.size(),
                "a walk's poses must have one length");
        for (const View<const i32> values : {x, y, heading}) require(all_in_range(values, -FAR + 1, FAR), NO_STATE);
        // Only of the first piece that a body has may the beginning be forgotten.
        const bool is_first = timelines_.pieces(body).empty();
        require(is_first ? first <= drawn_from : first == drawn_from, NO_STATE);
        check(body, drawn_from);
        walk(body, first, nb::borrow(state[1]), nb::borrow(state[2]), {key, stride, sway, turn_limit, stays},
             {x[0], y[0], heading[0]});
        WalkPiece& walk = *timelines_.pieces(body).back().walk;
        walk.drawn_from = drawn_from;
        walk.x = copied(x), walk.y = copied(y), walk.heading = copied(heading);
    }

    const KnownWays& known_ways(i64 first, i64 end) {
        KnownWays& ways = first < end ? ways_ : no_ways_;
        ways.update(timelines_, first, end);
        return ways;
    }

    Timelines timelines_;
    KnownWays ways_, no_ways_;  // of the steps that were asked for last, and of none
    MeetingSearch search_;
    std::vector<nb::object> meshes_;
};

// The poses of one body at each of some steps.
std::tuple<Array<i64>, Array<i64>, Array<i64>, Array<u8>, Array<i8>> dense(const Window& window, i64 body, i64 first,
                                                                           i64 end) {
    require(0 <= body && body < window.bodies(), "there is no such body");
    require(window.first <= first && first <= end && end <= window.end, "the steps must lie within the window");
    const i64 count = end - first;
    auto x = Array<i64>::empty({count}), y = Array<i64>::empty({count}), heading = Array<i64>::empty({count});
    auto away = Array<u8>::empty({count});
    auto posture = Array<i8>::empty({count});
    for (i64 run = window.start[body]; run < window.start[body + 1]; ++run) {
        const i64 from = std::max(first, window.step[run]), until = std::min(end, window.run_end(body, run));
        for (i64 step = from; step < until; ++step) {
            const i64 j = step - first;
            x[j] = window.x[run], y[j] = window.y[run], heading[j] = window.heading[run];
            away[j] = window.away[run], posture[j] = window.posture[run];
        }
    }
    return {std::move(x), std::move(y), std::move(heading), std::move(away), std::move(posture)};
}

// The runs of bodies whose poses are given at each step.
OwnedWindow window_of_poses(i64 first, View<const i64, 2> x, View<const i64, 2> y, View<const i64, 2> heading,
                            View<const u8, 2> away, View<const i8, 2> posture) {
    require(x.shape == y.shape && x.shape == heading.shape && x.shape == away.shape && x.shape == posture.shape,
            "all arrays must be (bodies, steps)");
    const i64 bodies = x.shape[0], steps = x.shape[1];
    require(-LATEST < first && first < LATEST - steps, "first must be a step");
    OwnedWindow window;
    window.first = first;
    window.end = first + steps;
    window.start.push_back(0);
    for (i64 body = 0; body < bodies; ++body) {
        for (i64 j = 0; j < steps; ++j) {
            const bool goes_on = j > 0 && x(body, j) == x(body, j - 1) && y(body, j) == y(body, j - 1) &&
                                 heading(body, j) == heading(body, j - 1) && away(body, j) == away(body, j - 1) &&
                                 posture(body, j) == posture(body, j - 1);
            if (goes_on) continue;
            window.step.push_back(first + j);
            window.x.push_back(x(body, j));
            window.y.push_back(y(body, j));
            window.heading.push_back(heading(body, j));
            window.away.push_back(away(body, j));
            window.posture.push_back(posture(body, j));
        }
        window.start.push_back(static_cast<i64>(window.step.size()));
    }
    return window;
}

using WindowState = std::tuple<i64, i64, View<const i64>, View<const i64>, View<const i64>, View<const i64>,
                               View<const i64>, View<const u8>, View<const i8>>;

// The window that `__getstate__` was called of.
OwnedWindow window_of_state(const WindowState& state) {
    const auto& [first, end, start, step, x, y, heading, away, posture] = state;
    constexpr const char* message = "this is no state of a window";
    const i64 runs = step.size(), bodies = start.size() - 1;
    require(-LATEST < first && first <= end && end < LATEST, message);
    require(
        x.size() == runs && y.size() == runs && heading.size() == runs && away.size() == runs && posture.size() == runs,
        message);
    require(bodies >= 0 && start[0] == 0 && start[bodies] == runs, message);
    for (i64 body = 0; body < bodies; ++body) {
        require(start[body] <= start[body + 1] && (start[body] == start[body + 1]) == (first == end), message);
    }
    for (i64 body = 0; body < bodies; ++body) {
        for (i64 run = start[body]; run < start[body + 1]; ++run) {
            const bool follows = run == start[body] ? step[run] == first : step[run] > step[run - 1];
            require(follows && step[run] < end, message);
        }
    }
    return {first,           end,          copied(start),  copied(step), copied(x), copied(y),
            copied(heading), copied(away), copied(posture)};
}

template <auto Member>
auto column() {
    return [](nb::handle self) { return border::borrowed(nb::cast<const OwnedWindow&>(self).view().*Member, self); };
}

}  // namespace

void bind_timelines(nb::module_& m) {
    nb::class_<OwnedWindow>(m, "Window", R"(The runs of equal pose of some bodies over consecutive steps.

The runs of body b are number start[b] to start[b + 1] - 1. Each lasts until the next one of its body
begins, the last one until `end`. Arrays are read-only.

Args:
    first: The first step.
    x: int64 (bodies, steps), the pose of each body at each step, lattice units.
    y: int64 (bodies, steps), lattice units.
    heading: int64 (bodies, steps), 1/4096 turn.
    away: uint8 (bodies, steps), not 0 while a body isn't at home.
    posture: int8 (bodies, steps), number of the posture.)")
        .def(
            "__init__",
            [](OwnedWindow* self, i64 first, View<const i64, 2> x, View<const i64, 2> y, View<const i64, 2> heading,
               View<const u8, 2> away, View<const i8, 2> posture) {
                new (self) OwnedWindow(window_of_poses(first, x, y, heading, away, posture));
            },
            "first"_a, "x"_a, "y"_a, "heading"_a, "away"_a, "posture"_a)
        .def_ro("first", &OwnedWindow::first, "The first step.")
        .def_ro("end", &OwnedWindow::end, "One past the last step.")
        .def_prop_ro("start", column<&Window::start>(), "int64 (bodies + 1,), the first run of each body.")
        .def_prop_ro("step", column<&Window::step>(), "int64 (runs,), the step at which each begins.")
        .def_prop_ro("x", column<&Window::x>(), "int64 (runs,), lattice units.")
        .def_prop_ro("y", column<&Window::y>(), "int64 (runs,), lattice units.")
        .def_prop_ro("heading", column<&Window::heading>(), "int64 (runs,), 1/4096 turn.")
        .def_prop_ro("away", column<&Window::away>(), "uint8 (runs,), not 0 while the body isn't at home.")
        .def_prop_ro("posture", column<&Window::posture>(), "int8 (runs,), number of the posture.")
        .def(
            "dense",
            [](const OwnedWindow& self, i64 body, i64 first, i64 end) { return dense(self.view(), body, first, end); },
            "body"_a, "first"_a, "end"_a,
            R"(Return the poses of a body at each of the steps from `first` to `end` - 1.

Returns:
    x, y, heading int64, away uint8 and posture int8, (steps,) each.)")
        .def(
            "__getstate__",
            [](const OwnedWindow& self) {
                return std::tuple(self.first, self.end, array_of(self.start), array_of(self.step), array_of(self.x),
                                  array_of(self.y), array_of(self.heading), array_of(self.away),
                                  array_of(self.posture));
            },
            nb::sig("def __getstate__(self) -> tuple[typing.Any, ...]"))
        .def(
            "__setstate__",
            [](OwnedWindow& self, const WindowState& state) { new (&self) OwnedWindow(window_of_state(state)); },
            nb::sig("def __setstate__(self, state: tuple[typing.Any, ...]) -> None"));

    m.def(
        "due_rows",
        [](View<const i64> steps, i64 now) {
            std::vector<i64> rows;
            for (i64 row = 0; row < steps.size(); ++row) {
                if (steps[row] <= now) rows.push_back(row);
            }
            return rows;
        },
        "steps"_a, "now"_a, R"(Return the rows that are due at a step, in order.

Args:
    steps: int64 (rows,), the step at which each is due.
    now: The step.)");

    nb::class_<OwnedTimelines>(m, "Timelines", R"(The motion of each body of a run, piece after piece.

A piece begins at a step and holds until the next one of its body begins.

Args:
    bodies: Number of bodies.
    step_us: Length of a step.)")
        .def(nb::init<i64, i64>(), "bodies"_a, "step_us"_a)
        .def("follow", &OwnedTimelines::follow, "body"_a, "step"_a, "track"_a, "posture_us"_a, "postures"_a,
             R"(Let a body follow a track from a step on, instead of what it would have done from then on.

Args:
    body: Number of the body.
    step: The first step.
    track: Breakpoints, whose times are since the start of the run.
    posture_us: int64 (n,), when it takes another posture.
    postures: int8 (n + 1,); number i holds before posture_us[i], the last one from then on.)")
        .def("walk", &OwnedTimelines::walk, "body"_a, "step"_a, nb::arg("walls"), nb::arg("space"), "rule"_a, "start"_a,
             nb::sig("def walk(self, body: int, step: int, walls: Mesh, space: Mesh, rule: tuple[typing.Any, ...], "
                     "start: tuple[int, int, int]) -> None"),
             "Let a body walk at random from a step on; see `trace_meander`.")
        .def("pose", &OwnedTimelines::pose, "body"_a, "step"_a, "Return x, y, heading and away of a body at a step.")
        .def("poses", &OwnedTimelines::poses, "steps"_a,
             "Return x, y, heading and away of all bodies at some steps: int64 (steps, bodies, 4).")
        // Not unlocked: random walks are drawn on as they are asked for.
        .def("meetings", &OwnedTimelines::meetings, "rows"_a, "distances"_a, "first"_a, "end"_a,
             R"(Return for each of some bodies the first meeting to which it has to react.

Two bodies meet when their middles come nearer than a distance while they approach, or when they
overlap and don't part.

Args:
    rows: int64 (rows,), the bodies.
    distances: What each of them keeps from all bodies: see `Distances`.
    first: The first step at which one may react.
    end: One past the last one.

Returns:
    Rows of the body, the step at which it has to react, the step in which they meet, and the other body.
    Bodies without a meeting are left out.)")
        .def("meeting_on", &OwnedTimelines::meeting_on, "row"_a, "track"_a, "distances"_a, "first"_a, "end"_a,
             R"(Return the first meeting of a body if it followed a track.

Args:
    row: The body.
    track: Breakpoints, which it would follow from step `first` on.
    distances: What it keeps from all bodies, (1, bodies) each: see `Distances`.
    first: The first step.
    end: One past the last step at which it has to react.

Returns:
    The step in which they meet and the other body; -1 and -1 if it meets nobody.)")
        .def("meeting_at_rest", &OwnedTimelines::meeting_at_rest, "row"_a, "distances"_a, "first"_a, "end"_a,
             "Return the first meeting of a body if it stood still from step `first` on; as `meeting_on`.")
        .def("rests", &OwnedTimelines::rests, "body"_a, "first"_a, "end"_a,
             "Return whether a body doesn't leave its place in the steps from `first` to `end` - 1.")
        .def("way_after_a_wait", &OwnedTimelines::way_after_a_wait, "row"_a, "step"_a, "waits"_a, "distances"_a,
             "end"_a,
             R"(Return how a body goes on after the first wait that lets it.

Args:
    row: The body.
    step: The present step.
    waits: int64 (n,), steps for which it stands.
    distances: What it keeps from all bodies, (1, bodies) each.
    end: One past the last step in which it must meet nobody.

Returns:
    Breakpoints from now on, the last of them, and how much later they continue the track: see `Continued`. None if
    it is free after no wait.)")
        .def("way_by_a_place", &OwnedTimelines::way_by_a_place, "body"_a, "step"_a, "met"_a, "places"_a, "waits"_a,
             "rests"_a, "distances"_a, "end"_a,
             nb::sig("def way_by_a_place(self, body: tuple[typing.Any, ...], step: int, met: int, "
                     "places: numpy.typing.NDArray[numpy.int64], waits: numpy.typing.NDArray[numpy.int64], "
                     "rests: int, distances: tuple[typing.Any, ...], end: int) "
                     "-> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None"),
             R"(Return how a body goes on by the first place that lets it.

Args:
    body: Its row, how it goes there, and how it can stand: see `Yielder`.
    step: The present step.
    met: The step in which somebody would be in its way; it goes on with its next stop after that.
    places: int64 (n, 2), places to try [lattice].
    waits: int64 (m,), steps for which it stays at a place.
    rests: Steps for which it stays where it could stay until `end`, but go on after none of the waits; 0: it
        needn't be able to stay, and doesn't.
    distances: What it keeps from all bodies, (1, bodies) each.
    end: One past the last step in which it must meet nobody.

Returns:
    As `way_after_a_wait`.)")
        .def("way_past", &OwnedTimelines::way_past, "body"_a, "step"_a, "met"_a, "in_way"_a, "waits"_a, "distances"_a,
             "end"_a,
             nb::sig("def way_past(self, body: tuple[typing.Any, ...], step: int, met: int, "
                     "in_way: tuple[typing.Any, ...], waits: numpy.typing.NDArray[numpy.int64], "
                     "distances: tuple[typing.Any, ...], end: int) "
                     "-> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None"),
             R"(Return how a body goes on past another one, later or by a point beside it.

Args:
    body: Its row, how it goes there, and how it can stand: see `Yielder`.
    step: The present step.
    met: The step in which the other one would be in its way.
    in_way: The other one, and where it may pass it: see `BodyInWay`.
    waits: int64 (n,), steps for which it waits first, unless the other one stays.
    distances: What it keeps from all bodies, (1, bodies) each.
    end: One past the last step in which it must meet nobody, and up to which the other one stays.

Returns:
    As `way_after_a_wait`.)")
        .def("way_aside", &OwnedTimelines::way_aside, "body"_a, "step"_a, "met"_a, "aside"_a, "waits"_a, "rests"_a,
             "distances"_a, "end"_a,
             nb::sig("def way_aside(self, body: tuple[typing.Any, ...], step: int, met: int, "
                     "aside: tuple[typing.Any, ...], waits: numpy.typing.NDArray[numpy.int64], rests: int, "
                     "distances: tuple[typing.Any, ...], end: int) "
                     "-> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None"),
             R"(Return how a body steps aside and comes back, by a place nearby or else one farther away.

Args:
    body: Its row, how it goes there, and how it can stand: see `Yielder`.
    step: The present step.
    met: The step in which somebody would be in its way.
    aside: Where it looks for places: see `AsideSearch`.
    waits: int64 (n,), steps for which it stays at a place.
    rests: See `way_by_a_place`; for so many steps nobody may come near to a place.
    distances: What it keeps from all bodies, (1, bodies) each.
    end: One past the last step in which it must meet nobody.

Returns:
    As `way_after_a_wait`.)")
        .def("takes_stop", &OwnedTimelines::takes_stop, "row"_a, "space"_a, "step"_a, "met"_a, "other"_a, "near"_a,
             "end"_a,
             R"(Return whether another body stays where a body wants to stop next.

Args:
    row: The body.
    space: Where its middle may be.
    step: The present step.
    met: The step after which it stops.
    other: The other body.
    near: How near to the stop that one must be [lattice].
    end: One past the last step in which it must stay.)")
        .def("way_round", &OwnedTimelines::way_round, "body"_a, "step"_a, "met"_a, "discs"_a, "beside"_a,
             nb::sig("def way_round(self, body: tuple[typing.Any, ...], step: int, met: int, "
                     "discs: numpy.typing.NDArray[numpy.int64], "
                     "beside: collections.abc.Callable[[int, int], tuple[int, int] | None]) "
                     "-> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None"),
             R"(Return how a body goes round others that stand, to its next stop.

Args:
    body: Its row, how it goes there, and how it can stand: see `Yielder`.
    step: The present step.
    met: A moment; it goes on with its next stop after that [us].
    discs: x, y and the distance to keep of each of the others [lattice], int64 (n, 3).
    beside: Called with x and y of a stop that one of them has taken; returns where to stop instead, or None.

Returns:
    As `way_after_a_wait`; None if there is no way or no place.)")
        .def("way_from_here", &OwnedTimelines::way_from_here, "body"_a, "step"_a, "met"_a, "may_stop"_a,
             nb::sig("def way_from_here(self, body: tuple[typing.Any, ...], step: int, met: int, "
                     "may_stop: collections.abc.Callable[[int, int], bool]) "
                     "-> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None"),
             R"(Return how a body goes on that stops where it is, in place of its next stop.

Args:
    body: Its row, how it goes there, and how it can stand: see `Yielder`.
    step: The present step.
    met: A moment; the stop is the next one after that [us].
    may_stop: Called with x and y of the stop; returns whether it may.

Returns:
    As `way_after_a_wait`; None if it may not, or no way leads on.)")
        .def("places_aside", &OwnedTimelines::places_aside, "row"_a, "step"_a, "end"_a, "part_of_cell"_a, "part"_a,
             "from_"_a, "search"_a, "reach"_a,
             R"(Return places that a body can step aside to, the nearest first: int64 (n, 2) [lattice].

Args:
    row: The body.
    step: The present step.
    end: The last step at which nobody else may come near.
    part_of_cell: int32 (rows, columns), the part of its space of each cell.
    part: Its part.
    from_: x and y from where it goes [lattice].
    search: How many cells to each side it looks, at every so many of them, and for how many places.
    reach: int64 (bodies,), how near the others may come to a place [lattice].)")
        .def("standing", &OwnedTimelines::standing, "row"_a, "step"_a, "steps"_a, "reach"_a,
             R"(Return where others stand, int64 (n, 3): x, y and how far to stay away from each [lattice].

They stand for so many steps from a step on, or have stopped by the end of those, and stay then.

Args:
    row: The body from which they are others.
    step: The step.
    steps: How many.
    reach: int64 (bodies,), how far to stay away from each [lattice].)")
        .def("window", &OwnedTimelines::window, "first"_a, "end"_a,
             "Return the runs of equal pose of all bodies in the steps from `first` to `end` - 1.")
        .def("runs", &OwnedTimelines::runs, "body"_a, "first"_a, "end"_a,
             "Return the runs of equal pose of one body in the steps from `first` to `end` - 1.")
        .def("forget", &OwnedTimelines::forget, "before"_a, "Drop what is only needed for steps earlier than `before`.")
        .def("__copy__", &OwnedTimelines::copy, "Return an independent copy.")
        .def("__getstate__", &OwnedTimelines::state, nb::sig("def __getstate__(self) -> tuple[typing.Any, ...]"))
        .def(
            "__setstate__",
            [](OwnedTimelines& self, nb::tuple state) {
                require(state.size() == 3, NO_STATE);
                const i64 bodies = part<i64>(state[0]);
                // Checked before so many are made room for.
                require(nb::isinstance<nb::list>(state[2]) && static_cast<i64>(nb::len(nb::handle(state[2]))) == bodies,
                        NO_STATE);
                OwnedTimelines result(bodies, part<i64>(state[1]));
                result.restore(nb::borrow<nb::list>(state[2]));
                new (&self) OwnedTimelines(std::move(result));
            },
            nb::sig("def __setstate__(self, state: tuple[typing.Any, ...]) -> None"));
}

}  // namespace fleet2d
