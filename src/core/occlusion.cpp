#include "occlusion.hpp"

#include <algorithm>

namespace fleet2d {

bool Heights::holds(i64 piece, i64 x, i64 y) const {
    bool is_inside = false;
    Point a = corner(start[piece + 1] - 1);
    for (i64 i = start[piece]; i < start[piece + 1]; ++i) {
        const Point b = corner(i);
        const i64 side = orient(a.x, a.y, b.x, b.y, x, y);
        if (side == 0 && std::min(a.x, b.x) <= x && x <= std::max(a.x, b.x) && std::min(a.y, b.y) <= y &&
            y <= std::max(a.y, b.y)) {
            return true;
        }
        // Edges to the right of the point that its horizontal meets, of their two ends the lower one included.
        if ((a.y > y) != (b.y > y) && (side > 0) == (b.y > a.y)) is_inside = !is_inside;
        a = b;
    }
    return is_inside;
}

i64 Heights::base(i64 posture, i64 x, i64 y) const {
    if (posture != LYING) return 0;
    i64 highest = 0;
    for (i64 piece = 0; piece < pieces(); ++piece) {
        if (top[piece] > highest && holds(piece, x, y)) highest = top[piece];
    }
    return highest;
}

bool Heights::hides(const Pose& eye, i64 px, i64 py, i64 from, i64 to) const {
    const i64 left = eye.x + std::min(px, i64{0}), right = eye.x + std::max(px, i64{0});
    const i64 below = eye.y + std::min(py, i64{0}), above = eye.y + std::max(py, i64{0});
    for (i64 piece = 0; piece < pieces(); ++piece) {
        if (boxes(piece, 0) > right || boxes(piece, 2) < left || boxes(piece, 1) > above || boxes(piece, 3) < below ||
            (top[piece] < from && top[piece] < to)) {
            continue;
        }
        const auto from_eye = [&](i64 i) { return Point{corners(i, 0) - eye.x, corners(i, 1) - eye.y}; };
        Point a = from_eye(start[piece + 1] - 1);
        for (i64 i = start[piece]; i < start[piece + 1]; ++i) {
            const Point b = from_eye(i);
            if (passes_low(px, py, a, b, to - from, top[piece] - from)) return true;
            a = b;
        }
    }
    return false;
}

u64 Obstacles::over_furniture(u64 points, const Pose& eye, i64 dx, i64 dy, View<const i64, 2> outline,
                              const Levels& levels) const {
    u64 left = points;
    for (i64 i = 0; i < outline.shape[0] && left != 0; ++i) {
        const u64 point = u64{1} << i;
        if ((left & point) == 0) continue;
        const i64 px = dx + outline(i, 0), py = dy + outline(i, 1);
        if (heights_->hides(eye, px, py, levels.eye, levels.base + levels.points[i])) left &= ~point;
    }
    return left;
}

const std::vector<Glimpse>& Obstacles::split(const Glimpse& whole, i64 onlooker, i64 other, const Pose& eye, i64 dx,
                                             i64 dy, View<const i64, 2> outline, const Levels& levels) {
    covers_.clear();
    for (i64 body = 0; body < radii_.size(); ++body) {
        if (body == onlooker || body == other) continue;
        const i64* const first = window_.step.data + window_.start[body];
        const i64* const last = window_.step.data + window_.start[body + 1];
        const i64* const after = std::upper_bound(first, last, whole.begin);
        for (i64 run = after - window_.step.data - 1;; ++run) {
            const i64 end = std::min(window_.run_end(body, run), whole.end);
            const u64 hidden = hidden_points(whole.points, body, run, eye, dx, dy, outline, levels);
            if (hidden != 0) covers_.push_back({std::max(window_.step[run], whole.begin), end, hidden});
            if (end == whole.end) break;
        }
    }
    std::sort(covers_.begin(), covers_.end(), [](const Glimpse& a, const Glimpse& b) { return a.begin < b.begin; });
    pieces_.clear();
    active_.clear();
    auto next = covers_.cbegin();
    for (i64 step = whole.begin; step < whole.end;) {
        std::erase_if(active_, [step](const Glimpse& cover) { return cover.end <= step; });
        for (; next != covers_.cend() && next->begin <= step; ++next) active_.push_back(*next);
        i64 end = next != covers_.cend() ? next->begin : whole.end;
        u64 points = whole.points;
        for (const Glimpse& cover : active_) {
            end = std::min(end, cover.end);
            points &= ~cover.points;
        }
        if (!pieces_.empty() && pieces_.back().points == points) {
            pieces_.back().end = end;
        } else {
            pieces_.push_back({step, end, points});
        }
        step = end;
    }
    return pieces_;
}

u64 Obstacles::hidden_points(u64 points, i64 body, i64 run, const Pose& eye, i64 dx, i64 dy, View<const i64, 2> outline,
                             const Levels& levels) const {
    if (window_.away[run] != 0) return 0;
    const i64 bx = window_.x[run] - eye.x, by = window_.y[run] - eye.y;
    u64 hidden = 0;
    for (i64 i = 0; i < outline.shape[0]; ++i) {
        const u64 point = u64{1} << i;
        const i64 px = dx + outline(i, 0), py = dy + outline(i, 1);
        if ((points & point) == 0 || !hides(px, py, bx, by, radii_[body])) continue;
        if (heights_ != nullptr) {
            const i64 posture = window_.posture[run];
            const i64 top = heights_->tops(body, posture) + heights_->base(posture, window_.x[run], window_.y[run]);
            const i64 rise = levels.base + levels.points[i] - levels.eye;
            if (!stays_below(rise, top - levels.eye, px * bx + py * by, px * px + py * py)) continue;
        }
        hidden |= point;
    }
    return hidden;
}

}  // namespace fleet2d
