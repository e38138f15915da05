// Many points looked at from one place: which are in sight, and which in range and angle.
//
// And for methods that are not part of the core: what there is to ask over many steps, nothing twice
// in a row.
#pragma once

#include <vector>

#include "lens.hpp"
#include "poses.hpp"

namespace fleet2d {

// Which of the points, (n, 2), a line of sight leads to from (x, y), (n,).
Array<bool> points_in_sight(const Mesh& mesh, i64 x, i64 y, View<const i64, 2> points);

// Which of the points, (n, 2), are in range and within the angle of a camera, walls apart, (n,).
Array<bool> points_in_reach(Pose eye, i64 near_squared, i64 far_squared, i64 half_angle, View<const i64, 2> points);

// Whether a body is in view of a camera, to be asked: which two, where the camera is, and the body's centre.
struct Question {
    i64 camera, body;
    i64 eye_x, eye_y, eye_heading;  // lattice units, 1/4096 turn
    i64 body_x, body_y;

    bool operator==(const Question&) const = default;
};

// Where the bodies are that may be in view, all arrays (bodies, n).
struct Places {
    View<const i64, 2> x;    // lattice units
    View<const i64, 2> y;    // lattice units
    View<const u8, 2> away;  // not 0 while one isn't at home
};

struct Questions {
    std::vector<Question> asked;  // by camera and body
    Array<i32, 3> number;         // (cameras, bodies, n): which of them each step asks, from 1 on; 0 for none
};

// Who may be in view of which camera when: near enough, and at most `slack` [lattice units] beside the
// angle. `widest` is (cameras, bodies), the squared distance from which on nobody is in view; `robot` has
// the cameras, n poses from step `first` on. A question that is the one before is asked once.
Questions list_questions(const Lenses& lenses, View<const i64, 2> widest, i64 slack, const Poses& robot,
                         const Places& bodies, i64 first, i64 step_us);

}  // namespace fleet2d
