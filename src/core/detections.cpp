#include "detections.hpp"

#include <algorithm>
#include <bit>

namespace fleet2d {
namespace {

constexpr i64 MINUTE_US = 60'000'000;
constexpr i64 UNKNOWN = -1;

// Steps at which a camera has a user in view, while neither changes its pose.
struct Interval {
    i64 begin, end;  // steps; the last one is end - 1
    i64 camera, user;
    Pose eye;    // pose of the camera
    i64 dx, dy;  // position of the user relative to the camera [lattice units]
    i64 faces;   // 1/4096 turn
    i64 posture;
    i64 shown;             // points of the body in view, above 0
    i64 steady = UNKNOWN;  // steady_chance of all this, once that is known
    i64 eye_level = 0;     // height of the camera [mm], where heights matter

    bool comes_before(const Interval& other) const {
        return camera != other.camera ? camera < other.camera : user < other.user;
    }
};

Sighting read(View<const i64> row) {
    Sighting sighting;
    for (i64 i = 0; i < SIGHTING; ++i) sighting.*SIGHTING_COLUMNS[static_cast<std::size_t>(i)].second = row[i];
    return sighting;
}

void write(View<i64> row, const Sighting& sighting) {
    for (i64 i = 0; i < SIGHTING; ++i) row[i] = sighting.*SIGHTING_COLUMNS[static_cast<std::size_t>(i)].second;
}

// Finds the intervals in which a user is in view.
class IntervalFinder {
public:
    IntervalFinder(const Mesh& walls, const Lenses& lenses, const DetectionRule& rule, const Window& window,
                   Onlooker onlooker, View<const u64, 3> shown, View<const i64> radii, const Heights* heights)
        : walls_(walls),
          lenses_(lenses),
          rule_(rule),
          window_(window),
          onlooker_(onlooker),
          shown_(shown),
          hides_(radii.size() > 0),
          heights_(heights),
          obstacles_(window, radii, heights) {}

    // All intervals, in order of their first steps.
    std::vector<Interval> intervals() {
        const i64 cameras = lenses_.reach.shape[0], users = lenses_.reach.shape[1];
        for (i64 camera = 0; camera < cameras; ++camera) {
            for (i64 user = 0; user < users; ++user) compare(camera, user);
        }
        std::stable_sort(found_.begin(), found_.end(),
                         [](const Interval& a, const Interval& b) { return a.begin < b.begin; });
        return std::move(found_);
    }

private:
    // Step through the runs of both bodies in parallel.
    void compare(i64 camera, i64 user) {
        const i64 other = onlooker_.first_other + user;
        i64 run = window_.start[onlooker_.body], other_run = window_.start[other];
        i64 step = window_.first;
        while (step < window_.end) {
            const i64 run_end = window_.run_end(onlooker_.body, run);
            const i64 other_end = window_.run_end(other, other_run);
            const i64 end = std::min(run_end, other_end);
            if (window_.away[run] == 0 && window_.away[other_run] == 0) split(camera, user, run, other_run, step, end);
            step = end;
            if (run_end == end) ++run;
            if (other_end == end) ++other_run;
        }
    }

    // Add the intervals of steps `begin` to `end` - 1, in which both bodies rest; only the camera may pan.
    void split(i64 camera, i64 user, i64 run, i64 other_run, i64 begin, i64 end) {
        const i64 period = lenses_.period[camera];
        const Pose body{window_.x[run], window_.y[run], window_.heading[run]};
        const Pose other{window_.x[other_run], window_.y[other_run], window_.heading[other_run]};
        const i64 posture = window_.posture[other_run];
        for (i64 step = next_multiple(begin, period); step < end;) {
            i64 until = end;
            Pose eye = body;
            if (lenses_.moves[camera] != 0) {
                const i64 moment = step * rule_.step_us;
                eye = camera_pose(lenses_, camera, body, moment);
                if (lenses_.pan_count[camera] > 0) {
                    const i64 pan_us = lenses_.pan_us[camera];
                    const i64 turns = (floor_div(moment, pan_us) + 1) * pan_us;
                    until = std::min(end, -floor_div(-turns, rule_.step_us));
                }
            }
            const i64 dx = other.x - eye.x, dy = other.y - eye.y;
            Interval interval{step, until, camera, user, eye, dx, dy, other.heading, posture, 0};
            if (heights_ != nullptr) {
                const i64 own = window_.posture[run];
                interval.eye_level = heights_->eyes(camera, own) + heights_->base(own, body.x, body.y);
            }
            if (shown_.size() > 0) {
                split_by_method(interval);
            } else {
                add(interval, points_shown(camera, user, eye, dx, dy));
            }
            step = next_multiple(until, period);
        }
    }

    // Take over what another method says of each step.
    void split_by_method(Interval interval) {
        const View<const u64> shown = shown_[interval.camera][interval.user];
        const i64 end = interval.end;
        for (i64 step = interval.begin; step < end;) {
            const u64 points = shown[step - window_.first];
            interval.begin = step;
            while (step < end && shown[step - window_.first] == points) ++step;
            interval.end = step;
            add(interval, points);
        }
    }

    // Add an interval in which some points are in view, as far as no low furniture and no body hides them.
    void add(Interval interval, u64 points) {
        if (points == 0) return;
        const i64 count = lenses_.points[interval.camera] + 1, other = onlooker_.first_other + interval.user;
        View<const i64, 2> outline = lenses_.bodies[interval.camera][interval.user];
        outline.shape[0] = count;
        const Levels levels = heights_ == nullptr ? Levels{} : levels_of(interval);
        if (heights_ != nullptr) {
            points = obstacles_.over_furniture(points, interval.eye, interval.dx, interval.dy, outline, levels);
            if (points == 0) return;
        }
        if (!hides_) {
            interval.shown = std::popcount(points);
            found_.push_back(interval);
            return;
        }
        for (const Glimpse& glimpse : obstacles_.split({interval.begin, interval.end, points}, onlooker_.body, other,
                                                       interval.eye, interval.dx, interval.dy, outline, levels)) {
            if (glimpse.points == 0) continue;
            interval.begin = glimpse.begin;
            interval.end = glimpse.end;
            interval.shown = std::popcount(glimpse.points);
            found_.push_back(interval);
        }
    }

    Levels levels_of(const Interval& interval) const {
        const i64 x = interval.eye.x + interval.dx, y = interval.eye.y + interval.dy;
        return {interval.eye_level, heights_->base(interval.posture, x, y),
                heights_->points[interval.camera][interval.user][interval.posture]};
    }

    // Which points of a user's body are in view, bodies and low furniture between apart.
    u64 points_shown(i64 camera, i64 user, const Pose& eye, i64 dx, i64 dy) {
        if (dx * dx + dy * dy > lenses_.widest(camera, user)) return 0;
        const i64 half_angle = lenses_.half_angle[camera];
        if (!near_wedge(eye.heading, half_angle, dx, dy, lenses_.reach(camera, user))) return 0;
        if (eye.x != located_.x || eye.y != located_.y || triangle_ == OUTSIDE) {
            located_ = eye;
            triangle_ = locate(walls_, eye.x, eye.y);
        }
        return points_in_view(walls_, lenses_, camera, user, eye, triangle_, dx, dy);
    }

    const Mesh& walls_;
    const Lenses& lenses_;
    const DetectionRule& rule_;
    const Window& window_;
    const Onlooker onlooker_;
    const View<const u64, 3> shown_;
    const bool hides_;              // whether bodies hide each other
    const Heights* const heights_;  // null where height doesn't matter
    Obstacles obstacles_;
    std::vector<Interval> found_;
    Pose located_{};          // the camera that was located last
    i64 triangle_ = OUTSIDE;  // that holds it
};

// Visits the steps at which something may be noticed, become known, or be lost.
class Detector {
public:
    Detector(const Mesh& walls, const Lenses& lenses, const ErrorTables& errors, const DetectionRule& rule,
             const Window& window, Onlooker onlooker, const SightMemory& memory, std::vector<Interval> intervals)
        : walls_(walls),
          lenses_(lenses),
          errors_(errors),
          rule_(rule),
          window_(window),
          onlooker_(onlooker),
          memory_(memory),
          intervals_(std::move(intervals)),
          cameras_(lenses.widest.shape[0]),
          users_(lenses.widest.shape[1]) {
        for (const i64 seen : memory.seen) identities_in_view_ += seen;
        result_.newest.assign(static_cast<std::size_t>(memory.seen.size()), -1);
        latest_.assign(static_cast<std::size_t>(cameras_ * memory.seen.size()), -1);
        for (i64 c = 0; c < cameras_; ++c) {
            is_prompt_ &= lenses.latency[c] == 0 && memory.waiting(c, 1) == 0;
            has_ghosts_ |= errors.has_ghosts[c] != 0;
        }
        has_ghosts_ |= errors.injected.size() > 0;
        run_ = window.start[onlooker.body];
    }

    DetectionResult run() {
        for (now_ = next_step(window_.first); now_ < window_.end; now_ = next_step(now_ + 1)) {
            take_up();
            if (watch_on()) {
                --now_;  // the first step that isn't done is the next one
                continue;
            }
            const std::size_t before = result_.sighted_at.size();
            std::size_t i = 0;
            for (i64 c = 0; c < cameras_; ++c) {
                const bool looks = now_ % lenses_.period[c] == 0;
                for (; i < active_.size() && active_[i].camera == c; ++i) {
                    if (looks) look_at(active_[i]);
                }
                if (looks && errors_.has_ghosts[c] != 0) add_ghosts(c);
                if (looks) add_injected(c);
            }
            if (!is_prompt_) deliver();
            if (result_.sighted_at.size() > before || identities_in_view_ > 0) {
                if (note_events()) {
                    result_.steps = now_ + 1 - window_.first;
                    return std::move(result_);
                }
            }
        }
        result_.steps = window_.end - window_.first;
        return std::move(result_);
    }

private:
    // The first step from `step` on at which anything can happen.
    i64 next_step(i64 step) {
        std::erase_if(active_, [step](const Interval& interval) { return interval.end <= step; });
        if (!active_.empty() || has_ghosts_) return step;
        i64 next = next_interval_ < intervals_.size() ? intervals_[next_interval_].begin : window_.end;
        for (i64 c = 0; c < cameras_; ++c) {
            if (memory_.waiting(c, 1) > 0)
                next = std::min(next, read(memory_.backlog[c][memory_.waiting(c, 0) % memory_.backlog.shape[1]]).step);
        }
        if (identities_in_view_ > 0) {
            for (i64 i = 0; i < memory_.seen.size(); ++i) {
                if (memory_.seen[i] == 1) next = std::min(next, memory_.noticed[i] + rule_.patience);
            }
        }
        return std::max(step, next);
    }

    // Take up the intervals that begin at the present step.
    void take_up() {
        for (; next_interval_ < intervals_.size() && intervals_[next_interval_].begin <= now_; ++next_interval_) {
            const Interval& interval = intervals_[next_interval_];
            const auto place = std::upper_bound(active_.begin(), active_.end(), interval,
                                                [](const Interval& a, const Interval& b) { return a.comes_before(b); });
            active_.insert(place, interval);
        }
    }

    // Look at the only user in view for as long as nothing else can happen; whether any step was done.
    //
    // That is the usual case: a camera that doesn't err, and a user who counts as seen.
    bool watch_on() {
        if (active_.size() != 1 || !is_prompt_ || has_ghosts_ || identities_in_view_ != 1) return false;
        const Interval& target = active_.front();
        const i64 camera = target.camera, user = target.user, period = lenses_.period[camera];
        const View<i64> about = memory_.about[camera][user];
        if (memory_.seen[user] != 1 || lenses_.errs[camera] != 0 || at(about, About::FORCED) != 0) return false;
        i64 end = std::min(target.end, window_.end);
        if (next_interval_ < intervals_.size()) end = std::min(end, intervals_[next_interval_].begin);
        const i64 first = now_;
        for (; now_ < end; ++now_) {
            const bool looks = now_ % period == 0, notices = looks && is_detected(camera, user);
            if (!notices && now_ - memory_.noticed[user] >= rule_.patience) break;
            if (looks) ++at(about, About::IN_VIEW);
            if (!notices) continue;
            ++at(about, About::NOTICED);
            publish(camera, sighting_of(target));
        }
        return now_ > first;
    }

    // Record a user in view, if noticed.
    void look_at(Interval& target) {
        const i64 camera = target.camera;
        const View<i64> about = memory_.about[camera][target.user];
        ++at(about, About::IN_VIEW);
        const i64 forced = at(about, About::FORCED);
        if (forced == FORCED_MISS) return;
        const bool errs = lenses_.errs[camera] != 0;
        if (errs ? !is_noticed(target) : !is_detected(camera, target.user)) return;
        ++at(about, About::NOTICED);
        Sighting sighting = sighting_of(target);
        if (errs) perceive(target, sighting);
        if (forced != 0) sighting.identity = forced - FORCED_IDENTITY;
        record(camera, sighting);
    }

    // The truth about a user in view at the present step.
    Sighting sighting_of(const Interval& target) const {
        const i64 x = target.eye.x + target.dx, y = target.eye.y + target.dy;
        const i64 faces = target.faces, posture = target.posture, known_at = now_ + lenses_.latency[target.camera];
        return {known_at, target.camera, target.user, target.user, x, y, faces, posture, x, y, faces, posture};
    }

    // Whether a camera that doesn't err notices a user in view.
    bool is_detected(i64 camera, i64 user) const {
        return random_chance(stream(errors_.keys[camera][user], UserDraw::DETECT), now_) < lenses_.chance[camera];
    }

    // Whether a camera that errs notices a user in view.
    bool is_noticed(Interval& target) const {
        const i64 camera = target.camera;
        const View<const i64> table = errors_.table[camera];
        if (target.steady == UNKNOWN) {
            target.steady = steady_chance(table, target.eye.heading, target.dx, target.dy, target.faces, target.posture,
                                          target.shown);
        }
        const i64 minute = floor_mod(floor_div(rule_.start_us + now_ * rule_.step_us, MINUTE_US), MINUTES);
        const i64 chance = notice_chance(target.steady, table[AT_LIGHT + minute], lenses_.chance[camera]);
        return attention(table, errors_.keys[camera][target.user], memory_.about[camera][target.user], now_) < chance;
    }

    // Set what a noticed user is perceived as, in a sighting that holds the truth.
    void perceive(const Interval& target, Sighting& sighting) const {
        const i64 camera = target.camera;
        const View<const i64> table = errors_.table[camera];
        const View<const u64> keys = errors_.keys[camera][target.user];
        sighting.identity =
            identify(table, errors_.confusion[camera][target.user], keys, memory_.about[camera][target.user],
                     target.user, now_, distance_bin(table, target.dx, target.dy), rule_.patience);
        const Offset offset = perceived_offset(table, keys, now_, target.dx, target.dy);
        sighting.x += offset.dx - target.dx;
        sighting.y += offset.dy - target.dy;
        const i64 turn = random_noise(stream(keys, UserDraw::HEADING), now_, table[HEADING_NOISE]);
        sighting.heading = (target.faces + turn) & (TURN - 1);
        sighting.posture =
            perceived_posture(table, target.posture, random_share(stream(keys, UserDraw::POSTURE), now_));
    }

    // Record the false positives of a look, each at its source if the source is in view.
    void add_ghosts(i64 camera) {
        while (window_.run_end(onlooker_.body, run_) <= now_) ++run_;
        if (window_.away[run_] != 0) return;
        Pose eye{window_.x[run_], window_.y[run_], window_.heading[run_]};
        if (lenses_.moves[camera] != 0) eye = camera_pose(lenses_, camera, eye, now_ * rule_.step_us);
        const View<const u64> keys = errors_.ghost_keys[camera];
        const i64 draw = random_share(stream(keys, GhostDraw::COUNT), now_);
        const i64 count = pick(errors_.ghosts[camera], draw);
        if (count == 0) return;
        const Sector sector{eye.x,
                            eye.y,
                            locate(walls_, eye.x, eye.y),
                            eye.heading,
                            lenses_.half_angle[camera],
                            lenses_.near_squared[camera],
                            lenses_.far_squared[camera]};
        // The draws about ghost k of a look have counter k, in a stream of that look.
        const auto key_of = [&](GhostDraw purpose) {
            return random_bits(stream(keys, purpose), static_cast<u64>(now_));
        };
        for (i64 k = 0; k < count; ++k) {
            const i64 source = pick(errors_.source[camera], random_share(key_of(GhostDraw::SOURCE), k));
            const GhostPlace place =
                place_of(sector, camera, source, random_bits(key_of(GhostDraw::PLACE), static_cast<u64>(k)));
            if (!place.appears) continue;
            const i64 person = pick(errors_.looks_like[camera], random_share(key_of(GhostDraw::IDENTITY), k));
            const i64 heading = random_below(key_of(GhostDraw::HEADING), static_cast<u64>(k), TURN);
            const i64 identity = person < users_ ? person : NOBODY;
            record(camera, {now_ + lenses_.latency[camera], camera, NOBODY, identity, place.x, place.y, heading, 0,
                            place.x, place.y, heading, 0});
        }
    }

    // Record the false positives that interventions inject.
    void add_injected(i64 camera) {
        for (i64 i = 0; i < errors_.injected.size(); ++i) {
            const View<const i64> row = errors_.injected[i];
            const auto value = [&](Injected column) { return row[static_cast<i64>(column)]; };
            if (value(Injected::CAMERA) != camera) continue;
            const i64 x = value(Injected::X), y = value(Injected::Y), heading = value(Injected::HEADING);
            record(camera, {now_ + lenses_.latency[camera], camera, NOBODY, value(Injected::IDENTITY), x, y, heading, 0,
                            x, y, heading, 0});
        }
    }

    // Source 0 is all that is in view; any other is a spot.
    GhostPlace place_of(const Sector& sector, i64 camera, i64 source, u64 key) const {
        if (source == 0) return ghost_anywhere(walls_, sector, key);
        const View<const i64> spot = errors_.spot[camera][source];
        const i64 dx = spot[0] - sector.x, dy = spot[1] - sector.y;
        const i64 squared = dx * dx + dy * dy;
        if (squared < sector.near_squared || squared > sector.far_squared ||
            !in_wedge(sector.heading, sector.half_angle, dx, dy)) {
            return {false, spot[0], spot[1]};
        }
        return ghost_at_spot(walls_, sector, spot, key);
    }

    // Publish a sighting, or put it in the backlog. Without latency the backlog isn't needed: the order is the same.
    void record(i64 camera, const Sighting& sighting) {
        if (is_prompt_) {
            publish(camera, sighting);
            return;
        }
        i64& length = memory_.waiting(camera, 1);
        const View<i64, 2> ring = memory_.backlog[camera];
        write(ring[(memory_.waiting(camera, 0) + length) % ring.size()], sighting);
        ++length;
    }

    // Publish the sightings of every camera's backlog that are known by now.
    void deliver() {
        for (i64 c = 0; c < cameras_; ++c) {
            i64 &begin = memory_.waiting(c, 0), &length = memory_.waiting(c, 1);
            const View<i64, 2> ring = memory_.backlog[c];
            while (length > 0) {
                const Sighting sighting = read(ring[begin]);
                if (sighting.step > now_) break;
                publish(c, sighting);
                begin = (begin + 1) % ring.size();
                --length;
            }
        }
    }

    void publish(i64 camera, const Sighting& sighting) {
        const i64 identities = memory_.noticed.size();
        const i64 identity = sighting.identity == NOBODY ? identities - 1 : sighting.identity;
        i64& latest = latest_[static_cast<std::size_t>(camera * identities + identity)];
        if (latest < 0 || !sighting.repeats(result_.distinct[static_cast<std::size_t>(latest)])) {
            latest = static_cast<i64>(result_.distinct.size());
            result_.distinct.push_back(sighting);
        }
        result_.sighted_at.push_back(sighting.step);
        result_.index.push_back(static_cast<i32>(latest));
        result_.newest[static_cast<std::size_t>(identity)] = latest;
        memory_.noticed[identity] = now_;
    }

    // Note an event for each identity that comes into view or is lost; whether one ends the span.
    bool note_events() {
        bool stops = false;
        for (i64 i = 0; i < memory_.noticed.size(); ++i) {
            const i64 noticed = memory_.noticed[i];
            const bool was_seen = memory_.seen[i] == 1;
            const bool is_seen = noticed == now_ || (was_seen && now_ - noticed < rule_.patience);
            if (is_seen == was_seen) continue;
            memory_.seen[i] = is_seen;
            identities_in_view_ += is_seen ? 1 : -1;
            result_.events.push_back({now_, i, is_seen ? SightEvent::SEEN : SightEvent::LOST});
            stops |= is_seen ? rule_.stop_seen : rule_.stop_lost;
        }
        return stops;
    }

    const Mesh& walls_;
    const Lenses& lenses_;
    const ErrorTables& errors_;
    const DetectionRule& rule_;
    const Window& window_;
    const Onlooker onlooker_;
    const SightMemory& memory_;
    const std::vector<Interval> intervals_;  // in order of their first steps
    std::size_t next_interval_ = 0;          // that is still to come
    std::vector<Interval> active_;           // at the present step, in order of camera and user
    const i64 cameras_, users_;
    bool is_prompt_ = true;  // every sighting becomes known at once
    bool has_ghosts_ = false;
    i64 identities_in_view_ = 0;
    i64 run_ = 0;  // of the onlooker at the present step
    i64 now_ = 0;
    std::vector<i64>
        latest_;  // (cameras * identities,) what each camera last saw of each, among the distinct; -1: none
    DetectionResult result_{};
};

}  // namespace

DetectionResult detect(const Mesh& walls, const Lenses& lenses, const ErrorTables& errors, const DetectionRule& rule,
                       const Window& window, Onlooker onlooker, const SightMemory& memory, View<const u64, 3> shown,
                       View<const i64> radii, const Heights* heights) {
    auto intervals = IntervalFinder(walls, lenses, rule, window, onlooker, shown, radii, heights).intervals();
    return Detector(walls, lenses, errors, rule, window, onlooker, memory, std::move(intervals)).run();
}

}  // namespace fleet2d
