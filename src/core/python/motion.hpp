// Tracks and walks as Python holds them.
#pragma once

#include "../motion.hpp"
#include "poses.hpp"

namespace fleet2d {

// The named tuples of `fleet2d.kernels`.
template <>
inline constexpr std::size_t border::members_of<Breakpoints> = 5;

template <>
inline constexpr std::size_t border::members_of<PosesToFill> = 4;

template <>
inline constexpr std::size_t border::members_of<WalkRule> = 5;

}  // namespace fleet2d
