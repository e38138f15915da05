// Tracks and walks as Python holds them.
#pragma once

#include "../motion.hpp"
#include "poses.hpp"

namespace fleet2d {

// The named tuples of `fleet2d.kernels`.
template <>
inline constexpr auto border::members_of<Breakpoints> =
    std::tuple(&Breakpoints::time, &Breakpoints::x, &Breakpoints::y, &Breakpoints::heading, &Breakpoints::away);

template <>
inline constexpr auto border::members_of<PosesToFill> =
    std::tuple(&PosesToFill::x, &PosesToFill::y, &PosesToFill::heading, &PosesToFill::away);

template <>
inline constexpr auto border::members_of<WalkRule> =
    std::tuple(&WalkRule::key, &WalkRule::stride, &WalkRule::sway, &WalkRule::turn_limit, &WalkRule::stays);

}  // namespace fleet2d
