// What the cameras of one body see and perceive of other bodies over a span of steps.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "lens.hpp"
#include "occlusion.hpp"
#include "perception.hpp"
#include "timelines.hpp"

namespace fleet2d {

// One sighting, as it stands in a row of an array. Where a camera was wrong about a person, `user` is NOBODY;
// where it didn't recognize one, `identity` is. What isn't true_ is as perceived.
struct Sighting {
    i64 step;  // when it becomes known
    i64 camera;
    i64 user;
    i64 identity;
    i64 x, y;  // lattice units
    i64 heading;
    i64 posture;
    i64 true_x, true_y;
    i64 true_heading;
    i64 true_posture;

    bool operator==(const Sighting&) const = default;
    // Whether it is as an earlier one, but for the step.
    bool repeats(Sighting earlier) const {
        earlier.step = step;
        return *this == earlier;
    }
};

// The columns of a row of sightings, by name.
inline constexpr std::array SIGHTING_COLUMNS = std::to_array<std::pair<const char*, i64 Sighting::*>>({
    {"STEP", &Sighting::step},
    {"CAMERA", &Sighting::camera},
    {"USER", &Sighting::user},
    {"IDENTITY", &Sighting::identity},
    {"X", &Sighting::x},
    {"Y", &Sighting::y},
    {"HEADING", &Sighting::heading},
    {"POSTURE", &Sighting::posture},
    {"TRUE_X", &Sighting::true_x},
    {"TRUE_Y", &Sighting::true_y},
    {"TRUE_HEADING", &Sighting::true_heading},
    {"TRUE_POSTURE", &Sighting::true_posture},
});
inline constexpr i64 SIGHTING = SIGHTING_COLUMNS.size();

// The state of a robot's perception between spans. Identities are users, and last an unknown person.
struct SightMemory {
    View<i64> noticed;     // (identities,) last step at which the identity was noticed; -1: never
    View<i64> seen;        // (identities,) 1 while the identity counts as seen
    View<i64, 3> about;    // (cameras, users, ABOUT) see About
    View<i64, 3> backlog;  // (cameras, rows, SIGHTING) a ring buffer of sightings that aren't known yet
    View<i64, 2> waiting;  // (cameras, 2) its first row, and its length
};

enum class SightEvent : i32 {
    LOST,  // an identity wasn't sighted for as long as the rule's patience
    SEEN,  // an identity came into view
};

// An identity that comes into view, or is lost.
struct IdentityEvent {
    i64 step;
    i64 identity;
    SightEvent kind;
};

// The settings that all cameras of a robot share.
struct DetectionRule {
    i64 patience;    // steps without a sighting after which an identity counts as lost
    i64 step_us;     // length of a step
    i64 start_us;    // time of day at step 0
    i64 burst;       // most sightings that become known in one step
    bool stop_lost;  // whether an event SightEvent::LOST ends the span
    bool stop_seen;  // whether an event SightEvent::SEEN ends the span
};

// The body with the cameras, and those that it looks at: bodies of a window, by number.
struct Onlooker {
    i64 body;         // the body with the cameras
    i64 first_other;  // the first of the others, as many as the lenses' users
};

// While nobody moves, a camera that doesn't err sees the same at each look, so sightings refer to what was seen.
struct DetectionResult {
    i64 steps;                          // done, the one that stopped it included
    std::vector<i64> sighted_at;        // the step of each sighting, in order
    std::vector<i32> index;             // the number of each among the distinct ones
    std::vector<Sighting> distinct;     // sightings that differ not only in the step, which is that of the first
    std::vector<i64> newest;            // (identities,) of each the number of its last sighting; -1: none
    std::vector<IdentityEvent> events;  // in order of (step, identity)
};

// Look at all others in the steps of a window, up to the first one with an event that stops it.
//
// First the intervals of steps are found in which somebody is in view: between two steps at which a pose
// changes, one verdict does for all. Only the steps in them, and those at which something may become known
// or be lost, are visited then, in order, each with its own draws.
//
// `shown` holds (cameras, users, steps) the points in view, bit i for number i, where another method decides that;
// else it is empty. `radii` are those of all bodies of the window, where they hide each other; else it is empty.
// `heights` is null where height doesn't matter.
DetectionResult detect(const Mesh& walls, const Lenses& lenses, const ErrorTables& errors, const DetectionRule& rule,
                       const Window& window, Onlooker onlooker, const SightMemory& memory, View<const u64, 3> shown,
                       View<const i64> radii, const Heights* heights);

}  // namespace fleet2d
