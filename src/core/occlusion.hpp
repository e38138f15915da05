// Bodies that come between a camera and somebody, and hide points of that body.
#pragma once

#include <vector>

#include "lens.hpp"
#include "timelines.hpp"

namespace fleet2d {

inline constexpr i64 FATTEST = 1 << 17;  // bodies have smaller radii [lattice units]

// Whether |cross| <= radius * sqrt(squared), exactly: neither square needs to fit into 64 bits.
// Of 0 <= squared < 2**54 and 0 < radius < FATTEST.
constexpr bool within_radius(i64 cross, i64 squared, i64 radius) {
    // cross = whole * radius + rest; both sides are squared and whole * whole * radius * radius taken off.
    const i64 size = cross < 0 ? -cross : cross, whole = size / radius, rest = size % radius;
    if (whole >= i64{1} << 27 || whole * whole > squared) return false;
    const i64 left = squared - whole * whole;
    // rest < radius, so that what is compared with stays below radius * radius * (2 * whole + 1).
    return left > 2 * whole || rest * (2 * whole * radius + rest) <= left * radius * radius;
}

// Whether a body of a radius with its centre at (bx, by) hides the point (px, py), both from the eye: the point of
// the sight line that is nearest to the centre lies between the ends, neither included, and within the radius.
constexpr bool hides(i64 px, i64 py, i64 bx, i64 by, i64 radius) {
    const i64 squared = px * px + py * py, along = px * bx + py * by;
    if (along <= 0 || along >= squared || bx * bx + by * by > squared + radius * radius) return false;
    return within_radius(px * by - py * bx, squared, radius);
}

// Steps in which the same points of a body are in view, one bit for each.
struct Glimpse {
    i64 begin, end;  // steps; the last one is end - 1
    u64 points;
};

// All bodies of a window, as obstacles to sight.
class Obstacles {
public:
    // `radii` holds one for each body of the window [lattice units]; none at all, and nobody hides anybody.
    Obstacles(const Window& window, View<const i64> radii) : window_(window), radii_(radii) {}

    // Split a glimpse of body `other` by body `onlooker`, neither of which changes its pose in it, at the steps
    // at which another set of points is left in view. `eye` is the camera, (dx, dy) the centre of `other` from
    // there, and `outline` its points, (points, 2), from its centre.
    const std::vector<Glimpse>& split(const Glimpse& whole, i64 onlooker, i64 other, const Pose& eye, i64 dx, i64 dy,
                                      View<const i64, 2> outline);

private:
    u64 hidden_points(u64 points, i64 body, i64 run, const Pose& eye, i64 dx, i64 dy, View<const i64, 2> outline) const;

    const Window& window_;
    const View<const i64> radii_;
    std::vector<Glimpse> covers_;  // which points are hidden by one body when, in order of the first steps
    std::vector<Glimpse> active_;  // of them, at the present step
    std::vector<Glimpse> pieces_;
};

}  // namespace fleet2d
