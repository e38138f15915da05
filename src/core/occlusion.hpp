// Bodies and low furniture that come between a camera and somebody, and hide points of that body.
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

inline constexpr i64 HIGHEST = 1 << 13;  // heights are below [mm]
inline constexpr i64 LYING = 2;          // the number of that posture

// The heights of all that is between floor and ceiling [mm]. Walls and what blocks sight reach up to the ceiling.
struct Heights {
    View<const i64, 2> eyes;     // (cameras, POSTURES): of each camera, by the posture of its owner
    View<const i64, 4> points;   // (cameras, users, POSTURES, points + 1): of the points of a body, as Lenses::bodies
    View<const i64, 2> tops;     // (bodies, POSTURES): of all bodies of the window
    View<const i64, 2> corners;  // (corners, 2): the outlines of furniture, one piece after the other [lattice units]
    View<const i64> start;       // (pieces + 1,) where each piece begins in `corners`
    View<const i64, 2> boxes;    // (pieces, 4): smallest x and y, and largest, of each
    View<const i64> top;         // (pieces,): of each piece

    i64 pieces() const { return top.size(); }
    Point corner(i64 number) const { return {corners(number, 0), corners(number, 1)}; }
    // Whether the floor of a piece holds a point, its outline included.
    bool holds(i64 piece, i64 x, i64 y) const;
    // How high a body at a point begins: on the highest furniture there if it lies, else on the floor.
    i64 base(i64 posture, i64 x, i64 y) const;
    // Whether furniture hides a point at (px, py) from an eye, of these heights: the line of sight meets the outline of
    // a piece, and is there not above its top.
    bool hides(const Pose& eye, i64 px, i64 py, i64 from, i64 to) const;
};

// Whether a line that rises by `rise` between its ends is `room` or less above its beginning, at the share along /
// whole of the way. Of |rise| and |room| below HIGHEST, and 0 <= along <= whole < 2**62.
constexpr bool stays_below(i64 rise, i64 room, i64 along, i64 whole) {
    // rise * along <= room * whole in two parts, since the products don't fit into 64 bits.
    constexpr i64 BITS = 20, REST = (i64{1} << BITS) - 1;
    const i64 high = rise * (along >> BITS) - room * (whole >> BITS);
    const i64 low = rise * (along & REST) - room * (whole & REST);
    return high + ((low + REST) >> BITS) <= 0;
}

// Whether the sight line to (px, py) meets the edge from a to b, all from the eye, and is there at most `room` above
// the eye; it rises by `rise`. An edge along the line is left to its neighbors, which meet the line at its ends.
constexpr bool passes_low(i64 px, i64 py, Point a, Point b, i64 rise, i64 room) {
    const i64 side_a = px * a.y - py * a.x, side_b = px * b.y - py * b.x;
    if (side_a == side_b || (side_a < 0 && side_b < 0) || (side_a > 0 && side_b > 0)) return false;
    const i64 sign = side_b > side_a ? 1 : -1;
    const i64 along = sign * (a.x * b.y - a.y * b.x), whole = sign * (side_b - side_a);
    return 0 <= along && along <= whole && stays_below(rise, room, along, whole);
}

// The heights of a camera and of the points of a body that it looks at [mm].
struct Levels {
    i64 eye = 0;
    i64 base = 0;            // of the furniture that the body lies on
    View<const i64> points;  // (points + 1,) above that
};

// Steps in which the same points of a body are in view, one bit for each.
struct Glimpse {
    i64 begin, end;  // steps; the last one is end - 1
    u64 points;
};

// All bodies of a window and all low furniture, as obstacles to sight.
class Obstacles {
public:
    // `radii` holds one for each body of the window [lattice units]; none at all, and nobody hides anybody. Without
    // `heights` furniture hides nobody, and all bodies are as high as any line.
    Obstacles(const Window& window, View<const i64> radii, const Heights* heights)
        : window_(window), radii_(radii), heights_(heights) {}

    // Which of some points furniture leaves in view; the arguments are as for `split`. It needs heights.
    u64 over_furniture(u64 points, const Pose& eye, i64 dx, i64 dy, View<const i64, 2> outline,
                       const Levels& levels) const;

    // Split a glimpse of body `other` by body `onlooker`, neither of which changes its pose in it, at the steps
    // at which another set of points is left in view. `eye` is the camera, (dx, dy) the centre of `other` from
    // there, and `outline` its points, (points, 2), from its centre. `levels` are theirs, if there are heights.
    const std::vector<Glimpse>& split(const Glimpse& whole, i64 onlooker, i64 other, const Pose& eye, i64 dx, i64 dy,
                                      View<const i64, 2> outline, const Levels& levels);

private:
    u64 hidden_points(u64 points, i64 body, i64 run, const Pose& eye, i64 dx, i64 dy, View<const i64, 2> outline,
                      const Levels& levels) const;

    const Window& window_;
    const View<const i64> radii_;
    const Heights* const heights_;
    std::vector<Glimpse> covers_;  // which points are hidden by one body when, in order of the first steps
    std::vector<Glimpse> active_;  // of them, at the present step
    std::vector<Glimpse> pieces_;
};

}  // namespace fleet2d
