#include "timelines.hpp"

#include <algorithm>

namespace fleet2d {
namespace {

// The first step at or after a moment [us].
i64 step_from(i64 moment, i64 step_us) { return -floor_div(-moment, step_us); }

template <class T>
View<const T> view_of(const std::vector<T>& values) {
    return {values.data(), {static_cast<i64>(values.size())}};
}

std::size_t index(i64 i) { return static_cast<std::size_t>(i); }

// Appends the runs of one body, in order of step, and joins those of equal pose.
class RunWriter {
public:
    explicit RunWriter(OwnedWindow& window) : window_(window), begin_(window.step.size()) {}

    void write(i64 step, const BodyPose& pose, i8 posture) {
        const std::size_t count = window_.step.size();
        if (count > begin_ && window_.x[count - 1] == pose.x && window_.y[count - 1] == pose.y &&
            window_.heading[count - 1] == pose.heading && window_.away[count - 1] == pose.away &&
            window_.posture[count - 1] == posture) {
            return;
        }
        window_.step.push_back(step);
        window_.x.push_back(pose.x);
        window_.y.push_back(pose.y);
        window_.heading.push_back(pose.heading);
        window_.away.push_back(static_cast<u8>(pose.away));
        window_.posture.push_back(posture);
    }

private:
    OwnedWindow& window_;
    std::size_t begin_;
};

i64 interpolate(i64 start, i64 change, i64 elapsed, i64 whole) {
    return start + floor_div(2 * change * elapsed + whole, 2 * whole);
}

// One stretch of a track: rest, or a straight leg, or a turn.
struct Stretch {
    BodyPose from;
    i64 began_us, whole_us;
    i64 dx, dy, turn;

    bool rests() const { return dx == 0 && dy == 0 && turn == 0; }
    BodyPose at(i64 moment_us) const {
        if (rests()) return from;
        const i64 elapsed = moment_us - began_us;
        return {interpolate(from.x, dx, elapsed, whole_us), interpolate(from.y, dy, elapsed, whole_us),
                interpolate(from.heading, turn, elapsed, whole_us) & (TURN - 1), from.away};
    }
};

// What a track does from breakpoint i on; before the first one and after the last one the body rests.
Stretch stretch_of(const TrackPiece& track, i64 i, i64 moment_us) {
    const std::size_t k = index(i);
    Stretch stretch{{track.x[k], track.y[k], track.heading[k], track.away[k]}, track.time[k], 0, 0, 0, 0};
    if (track.time[k] <= moment_us && k + 1 < track.time.size()) {
        stretch.whole_us = track.time[k + 1] - track.time[k];
        stretch.dx = track.x[k + 1] - track.x[k];
        stretch.dy = track.y[k + 1] - track.y[k];
        stretch.turn = turn_between(track.heading[k], track.heading[k + 1]);
    }
    return stretch;
}

// The last breakpoint at or before a moment, or the first one.
i64 breakpoint_at(const TrackPiece& track, i64 moment_us) {
    const auto after = std::upper_bound(track.time.begin(), track.time.end(), moment_us);
    return std::max<i64>(0, after - track.time.begin() - 1);
}

void write_track(const TrackPiece& track, i64 first, i64 end, i64 step_us, RunWriter& runs) {
    const i64 last = static_cast<i64>(track.time.size()) - 1;
    i64 i = breakpoint_at(track, first * step_us);
    const auto taken = std::upper_bound(track.posture_us.begin(), track.posture_us.end(), first * step_us);
    std::size_t posture = static_cast<std::size_t>(taken - track.posture_us.begin());
    const auto posture_until = [&] {
        return posture < track.posture_us.size() ? step_from(track.posture_us[posture], step_us) : end;
    };
    i64 step = first;
    while (step < end) {
        const i64 moment = step * step_us;
        while (i < last && track.time[index(i + 1)] <= moment) ++i;
        const Stretch stretch = stretch_of(track, i, moment);
        i64 stop = end;
        if (track.time[index(i)] > moment) {
            stop = std::min(end, step_from(track.time[index(i)], step_us));
        } else if (i < last) {
            stop = std::min(end, step_from(track.time[index(i + 1)], step_us));
        }
        const bool rests = stretch.rests();
        while (step < stop) {
            while (posture < track.posture_us.size() && posture_until() <= step) ++posture;
            runs.write(step, stretch.at(step * step_us), track.postures[posture]);
            step = rests ? std::min(stop, posture_until()) : step + 1;
        }
    }
}

// Draw a walk on, so that its pose at step `end` - 1 is known.
void draw_until(WalkPiece& walk, i64 end) {
    const i64 drawn = static_cast<i64>(walk.x.size());
    const i64 last = walk.drawn_from + drawn - 1;
    if (end - 1 <= last) return;
    const i64 count = end - last;
    const BodyPose at{walk.x[index(drawn - 1)], walk.y[index(drawn - 1)], walk.heading[index(drawn - 1)], 0};
    auto x = Array<i64>::empty({count}), y = Array<i64>::empty({count}), heading = Array<i64>::empty({count});
    auto away = Array<u8>::empty({count});
    trace_meander(walk.walls, walk.space, walk.rule, last, {at.x, at.y}, at.heading, {x, y, heading, away});
    for (i64 k = 1; k < count; ++k) {
        walk.x.push_back(static_cast<i32>(x[k]));
        walk.y.push_back(static_cast<i32>(y[k]));
        walk.heading.push_back(static_cast<i32>(heading[k]));
    }
}

BodyPose drawn_pose(const WalkPiece& walk, i64 step) {
    const std::size_t k = index(step - walk.drawn_from);
    return {walk.x[k], walk.y[k], walk.heading[k], 0};
}

}  // namespace

Window OwnedWindow::view() const {
    return {first,           end,        view_of(start),   view_of(step),
            view_of(x),      view_of(y), view_of(heading), view_of(away),
            view_of(posture)};
}

void Timelines::put(i64 body, Piece piece) {
    auto& pieces = bodies_[index(body)];
    while (!pieces.empty() && pieces.back().first >= piece.first) pieces.pop_back();
    pieces.push_back(std::move(piece));
    ++changes_[index(body)];
}

const Piece& Timelines::piece_at(i64 body, i64 step) const {
    const auto& pieces = bodies_[index(body)];
    const auto after = std::upper_bound(pieces.begin(), pieces.end(), step,
                                        [](i64 at, const Piece& piece) { return at < piece.first; });
    return after == pieces.begin() ? *after : *(after - 1);
}

BodyPose Timelines::pose(i64 body, i64 step) {
    const Piece& piece = piece_at(body, step);
    if (piece.walk) {
        draw_until(*piece.walk, step + 1);
        return drawn_pose(*piece.walk, step);
    }
    const i64 moment = step * step_us_;
    return stretch_of(*piece.track, breakpoint_at(*piece.track, moment), moment).at(moment);
}

OwnedWindow Timelines::window(i64 first_body, i64 end_body, i64 first, i64 end) {
    OwnedWindow window;
    window.first = first;
    window.end = end;
    window.start.push_back(0);
    for (i64 body = first_body; body < end_body; ++body) {
        RunWriter runs(window);
        const auto& pieces = bodies_[index(body)];
        for (std::size_t k = 0; k < pieces.size() && first < end; ++k) {
            const i64 from = std::max(first, pieces[k].first);
            const i64 until = k + 1 < pieces.size() ? std::min(end, pieces[k + 1].first) : end;
            if (from >= until) continue;
            if (pieces[k].walk) {
                draw_until(*pieces[k].walk, until);
                for (i64 step = from; step < until; ++step) runs.write(step, drawn_pose(*pieces[k].walk, step), 0);
            } else {
                write_track(*pieces[k].track, from, until, step_us_, runs);
            }
        }
        window.start.push_back(static_cast<i64>(window.step.size()));
    }
    return window;
}

void Timelines::forget(i64 before) {
    for (auto& pieces : bodies_) {
        std::size_t past = 0;
        while (past + 1 < pieces.size() && pieces[past + 1].first <= before) ++past;
        pieces.erase(pieces.begin(), pieces.begin() + static_cast<std::ptrdiff_t>(past));
        if (pieces.empty() || !pieces.front().walk) continue;
        WalkPiece& walk = *pieces.front().walk;
        const i64 drop = std::min(before - walk.drawn_from, static_cast<i64>(walk.x.size()) - 1);
        if (drop > 0) {
            for (auto* values : {&walk.x, &walk.y, &walk.heading})
                values->erase(values->begin(), values->begin() + drop);
            walk.drawn_from += drop;
        }
    }
}

}  // namespace fleet2d
