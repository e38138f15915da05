#include "occlusion.hpp"

#include <algorithm>

namespace fleet2d {

const std::vector<Glimpse>& Obstacles::split(const Glimpse& whole, i64 onlooker, i64 other, const Pose& eye, i64 dx,
                                             i64 dy, View<const i64, 2> outline) {
    covers_.clear();
    for (i64 body = 0; body < radii_.size(); ++body) {
        if (body == onlooker || body == other) continue;
        const i64* const first = window_.step.data + window_.start[body];
        const i64* const last = window_.step.data + window_.start[body + 1];
        const i64* const after = std::upper_bound(first, last, whole.begin);
        for (i64 run = after - window_.step.data - 1;; ++run) {
            const i64 end = std::min(window_.run_end(body, run), whole.end);
            const u64 hidden = hidden_points(whole.points, body, run, eye, dx, dy, outline);
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

u64 Obstacles::hidden_points(u64 points, i64 body, i64 run, const Pose& eye, i64 dx, i64 dy,
                             View<const i64, 2> outline) const {
    if (window_.away[run] != 0) return 0;
    const i64 bx = window_.x[run] - eye.x, by = window_.y[run] - eye.y;
    u64 hidden = 0;
    for (i64 i = 0; i < outline.shape[0]; ++i) {
        const u64 point = u64{1} << i;
        if ((points & point) != 0 && hides(dx + outline(i, 0), dy + outline(i, 1), bx, by, radii_[body])) {
            hidden |= point;
        }
    }
    return hidden;
}

}  // namespace fleet2d
