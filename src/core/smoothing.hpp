// Stays of a person given all evidence, earlier and later; and what to learn from them.
#pragma once

#include "stays.hpp"

namespace fleet2d {

// What is expected of a person's stays, given all evidence.
struct Moments {
    View<f64> time;      // (nodes,), bins
    View<f64, 2> exits;  // (nodes, rooms + 1), how often each is followed by what
    View<f64> arrivals;  // (patches,), how often who came, or changed patch, came there
    View<f64> moves;     // (rooms,), changes of patch
    View<f64> rests;     // (rooms,), bins without one
};

struct Smoothed {
    Array<f64, 2> places;  // (stretches, rooms), P(room) in each stretch
    Array<f64, 2> end;     // (stages, patches), probability after the last, given what was before
    Array<f64, 2> ahead;   // (stages, patches), how likely each before the first makes the evidence, largest 1
};

// Where a person was, given all evidence of some stretches; `moments` are added to.
//
// Between two stretches a person may go on once: leave a stage, with the chance to do so within the later one, or
// change patch within the room. With stretches of one bin that is a hidden Markov chain; with longer ones, what
// happens within a stretch is taken to happen as it begins. Who comes to a patch of which a part is in view is in
// that part with the chance of its size, and stays in it or out of it until the person moves or what is in view of
// it changes. In view one isn't perceived in any of n bins with (1 - detection)^n; out of view never, unless
// nothing of the patch was in view where somebody was perceived: positions may be noisy.
//
// `dawn` (stages, patches) is the probability before the first stretch, `dusk` (stages, patches) how likely each
// makes what comes after the last.
Smoothed smooth(const Ways& ways, const Stretches& stretches, View<const f64, 2> dawn, View<const f64, 2> dusk,
                const Moments& moments);

}  // namespace fleet2d
