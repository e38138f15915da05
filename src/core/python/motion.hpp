// Tracks and walks as Python holds them.
#pragma once

#include "../motion.hpp"
#include "poses.hpp"

namespace fleet2d {

// The named tuples of `fleet2d.kernels.motion`.
template <>
struct border::Fields<Breakpoints> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members =
        std::tuple(&Breakpoints::time, &Breakpoints::x, &Breakpoints::y, &Breakpoints::heading, &Breakpoints::away);
};

template <>
struct border::Fields<PosesToFill> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members =
        std::tuple(&PosesToFill::x, &PosesToFill::y, &PosesToFill::heading, &PosesToFill::away);
};

template <>
struct border::Fields<WalkRule> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members =
        std::tuple(&WalkRule::key, &WalkRule::stride, &WalkRule::sway, &WalkRule::turn_limit, &WalkRule::stays);
};

}  // namespace fleet2d
