// Timelines: the motion of each body of a run, piece after piece, and its runs of equal pose.
//
// Bodies rest most of the time. A window of a timeline lists the steps at which a body's pose changes, so that the
// cost of what is computed from it depends on the number of changes, not on the number of steps.
#pragma once

#include <memory>
#include <vector>

#include "motion.hpp"

namespace fleet2d {

// The pose of a body at a step.
struct BodyPose {
    i64 x, y;     // lattice units
    i64 heading;  // 1/4096 turn
    i64 away;     // 1 while it isn't at home

    bool operator==(const BodyPose&) const = default;
};

// The runs of equal pose of some bodies over the steps first to end - 1. The runs of body b are number start[b]
// to start[b + 1] - 1; each lasts until the next one of its body begins, the last one until `end`.
struct Window {
    i64 first = 0;
    i64 end = 0;
    View<const i64> start;    // (bodies + 1,)
    View<const i64> step;     // (runs,) at which each begins
    View<const i64> x;        // lattice units
    View<const i64> y;        // lattice units
    View<const i64> heading;  // 1/4096 turn
    View<const u8> away;      // not 0 while the body isn't at home
    View<const i8> posture;   // number of the posture

    i64 bodies() const { return start.size() - 1; }
    // The step before which a run of a body ends.
    i64 run_end(i64 body, i64 run) const { return run + 1 < start[body + 1] ? step[run + 1] : end; }
};

// A window that owns its arrays.
struct OwnedWindow {
    i64 first = 0;
    i64 end = 0;
    std::vector<i64> start, step, x, y, heading;
    std::vector<u8> away;
    std::vector<i8> posture;

    Window view() const;
};

// A track that owns its arrays, and the postures taken along it.
struct TrackPiece {
    std::vector<i64> time;  // us since the start of the run
    std::vector<i64> x, y, heading;
    std::vector<u8> away;
    std::vector<i64> posture_us;  // when another posture is taken [us]
    std::vector<i8> postures;     // number i holds before posture_us[i], the last one from then on
};

// A random walk between walls, and the poses that were drawn of it so far.
struct WalkPiece {
    Mesh walls;  // the owner of the timelines owns the memory of both meshes
    Mesh space;
    WalkRule rule;
    i64 drawn_from = 0;  // the step of the first pose that is kept
    std::vector<i32> x, y, heading;
};

// From step `first` on, until the next piece, a body follows a track or a random walk.
struct Piece {
    i64 first;
    std::shared_ptr<const TrackPiece> track;  // one of both
    std::shared_ptr<WalkPiece> walk;
};

class Timelines {
public:
    Timelines(i64 bodies, i64 step_us)
        : step_us_(step_us), bodies_(static_cast<std::size_t>(bodies)), changes_(bodies_.size()) {}

    i64 bodies() const { return static_cast<i64>(bodies_.size()); }
    i64 step_us() const { return step_us_; }
    const std::vector<Piece>& pieces(i64 body) const { return bodies_[static_cast<std::size_t>(body)]; }
    // How often a body has begun to do something else.
    i64 changes(i64 body) const { return changes_[static_cast<std::size_t>(body)]; }

    // From a step on, let a body do what a piece says; it replaces what the body would have done from then on.
    void put(i64 body, Piece piece);
    // Where a body is at a step that hasn't been forgotten.
    BodyPose pose(i64 body, i64 step);
    // The runs of some bodies over the steps first to end - 1.
    OwnedWindow window(i64 first_body, i64 end_body, i64 first, i64 end);
    // Drop what is only needed before a step.
    void forget(i64 before);

private:
    const Piece& piece_at(i64 body, i64 step) const;

    i64 step_us_;
    std::vector<std::vector<Piece>> bodies_;
    std::vector<i64> changes_;
};

}  // namespace fleet2d
