// Draws as Python holds them.
#pragma once

#include "../random.hpp"
#include "arrays.hpp"

namespace fleet2d {

// Bits, and the draws that they come from.
struct OwnedBits {
    nb::object owner;
    StepDraws& draws;
    Bits bits;
};

}  // namespace fleet2d
