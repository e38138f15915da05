// The cameras of a robot: their poses, and what is in their view.
#pragma once

#include "headings.hpp"
#include "line_of_sight.hpp"

namespace fleet2d {

// The constants of a robot's cameras, (cameras,) unless it says otherwise.
struct Lenses {
    View<const i64> near_squared;  // lattice units squared
    View<const i64> far_squared;   // lattice units squared
    View<const i64> half_angle;    // 1/8192 of a turn; 4096 and more is all round
    View<const i64> chance;        // probability of noticing a user in view, times 2**53
    View<const i64> moves;         // 0 if it is at the robot's centre and looks straight ahead
    View<const i64> forward;       // where it sits, in the robot's frame [lattice units]
    View<const i64> left;          // the same, to the left
    View<const i64> heading;       // where it looks, from the robot's heading
    View<const i64, 2> pans;       // (cameras, headings): added to `heading`, one after the other
    View<const i64> pan_count;     // how many of them
    View<const i64> pan_us;        // how long it looks in each
    View<const i64> period;        // steps from look to look
    View<const i64> latency;       // steps until a sighting is known
    View<const i64> errs;          // 1 where what is perceived can be wrong
    View<const i64> points;        // points of a user's body besides its centre that are looked at
    View<const i64, 4> bodies;     // (cameras, users, points + 1, 2): where they are, from the centre; it is first
    View<const i64, 2> reach;      // (cameras, users): how far they are from it
    View<const i64, 2> widest;     // (cameras, users): farthest distance of a centre in view, squared
};

struct Pose {
    i64 x, y;     // lattice units
    i64 heading;  // 1/4096 turn
};

// Whether anything within `reach` of (dx, dy) may lie within `half_angle` [1/8192 turn] of a heading, or on
// the border; exact at reach 0.
constexpr bool near_wedge(i64 heading, i64 half_angle, i64 dx, i64 dy, i64 reach) {
    if (half_angle >= TURN) return true;
    const i64 right = 2 * heading - half_angle, left = 2 * heading + half_angle;
    const i64 from_right = half_sine(right + 2 * QUARTER) * dy - half_sine(right) * dx;
    const i64 to_left = half_sine(left) * dx - half_sine(left + 2 * QUARTER) * dy;
    const i64 least = -reach * UNIT;
    // With a wedge of half a turn, both borders are one line: the test is the half plane.
    if (half_angle <= 2 * QUARTER) return from_right >= least && to_left >= least;
    return from_right >= least || to_left >= least;
}

// Whether (dx, dy) lies within `half_angle` [1/8192 turn] of a heading, or on the border.
constexpr bool in_wedge(i64 heading, i64 half_angle, i64 dx, i64 dy) {
    return near_wedge(heading, half_angle, dx, dy, 0);
}

// Where a camera is and where it looks, of a robot at `robot`; the offset is rounded to the lattice.
inline Pose camera_pose(const Lenses& lenses, i64 camera, Pose robot, i64 moment_us) {
    const i64 forward = lenses.forward[camera], left = lenses.left[camera];
    Pose pose = robot;
    if (forward != 0 || left != 0) {
        const i64 along = cosine(robot.heading), up = sine(robot.heading);
        pose.x += (forward * along - left * up + UNIT / 2) >> 30;
        pose.y += (forward * up + left * along + UNIT / 2) >> 30;
    }
    pose.heading += lenses.heading[camera];
    if (lenses.pan_count[camera] > 0) {
        const i64 turn = floor_mod(floor_div(moment_us, lenses.pan_us[camera]), lenses.pan_count[camera]);
        pose.heading += lenses.pans(camera, turn);
    }
    pose.heading &= TURN - 1;
    return pose;
}

// Which points of a user's body are in view of the camera at `eye`, bit i for number i, the user's centre being at
// (dx, dy) from it. `triangle` holds the eye.
inline u64 points_in_view(const Mesh& walls, const Lenses& lenses, i64 camera, i64 user, Pose eye, i64 triangle, i64 dx,
                          i64 dy) {
    const i64 near = lenses.near_squared[camera], far = lenses.far_squared[camera];
    const i64 half_angle = lenses.half_angle[camera];
    u64 shown = 0;
    for (i64 i = 0; i <= lenses.points[camera]; ++i) {
        const i64 px = dx + lenses.bodies(camera, user, i, 0), py = dy + lenses.bodies(camera, user, i, 1);
        const i64 squared = px * px + py * py;
        if (near <= squared && squared <= far && in_wedge(eye.heading, half_angle, px, py)) {
            shown |= u64{line_of_sight(walls, eye.x, eye.y, triangle, eye.x + px, eye.y + py)} << i;
        }
    }
    return shown;
}

}  // namespace fleet2d
