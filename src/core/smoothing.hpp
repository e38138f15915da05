// The stays of a person given all evidence, earlier and later: smoothing, and expected moments for learning.
#pragma once

#include "stays.hpp"

namespace fleet2d {

// Expected moments of a person's stays, given all evidence.
struct Moments {
    View<f64> time;      // (nodes,) bins spent in the node
    View<f64, 2> exits;  // (nodes, rooms + 1) transitions to each room, and to the next stage
    View<f64> arrivals;  // (patches,) arrivals at the patch, from another room or patch
    View<f64> moves;     // (rooms,) changes of patch
    View<f64> rests;     // (rooms,) bins without a change of patch
};

struct Smoothed {
    Array<f64, 2> places;  // (stretches, rooms) P(room) in each stretch
    Array<f64, 2> end;     // (stages, patches) filtered probability after the last stretch
    Array<f64, 2> ahead;   // (stages, patches) likelihood of all evidence for each state before the first, largest 1
};

// The distribution over rooms in each stretch, given all evidence; adds to `moments`.
//
// Between two stretches a person may make one transition: leave a stage, with the probability of doing so within
// the later stretch, or change patch within the room. With stretches of one bin that is a hidden Markov chain; with
// longer ones, transitions within a stretch count as if they happened at its begin. A person who comes to a patch is
// in its visible part with the probability of its size, and stays in or out of view until the person moves or the
// view changes. A person in view is missed in all of n bins with probability (1 - detection)^n; a person out of view
// is never perceived, unless nothing of the patch is in view: positions may be noisy.
//
// `prior` (stages, patches) is the probability before the first stretch, `future` (stages, patches) the likelihood
// of the evidence after the last one.
Smoothed smooth(const StayModel& model, const Stretches& stretches, View<const f64, 2> prior, View<const f64, 2> future,
                const Moments& moments);

}  // namespace fleet2d
