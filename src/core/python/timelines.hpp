// Windows as Python holds them.
#pragma once

#include "../timelines.hpp"
#include "arrays.hpp"

namespace fleet2d {

// A track as a piece of timelines. Raises ValueError: it can't be followed.
TrackPiece piece_of(const Breakpoints& track);

}  // namespace fleet2d

namespace nanobind::detail {

template <>
struct type_caster<fleet2d::Window> {
    NB_TYPE_CASTER(fleet2d::Window, const_name("Window"))

    bool from_python(handle source, uint32_t, cleanup_list*) noexcept {
        fleet2d::OwnedWindow* owned = nullptr;
        if (!nb::try_cast(source, owned) || owned == nullptr) return false;
        value = owned->view();
        return true;
    }
};

}  // namespace nanobind::detail
