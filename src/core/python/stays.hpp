// Stays as Python holds them: the named tuples of `fleet2d.kernels.stays`.
#pragma once

#include "../stays.hpp"
#include "arrays.hpp"

namespace fleet2d {

template <>
struct border::Fields<Stretches> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members = std::tuple(&Stretches::bins, &Stretches::hour, &Stretches::shown, &Stretches::begin,
                                               &Stretches::patch, &Stretches::share);
};

template <>
struct border::Fields<Ways> {
    static constexpr auto name = nb::detail::const_name("tuple[typing.Any, ...]");
    static constexpr auto members =
        std::tuple(&Ways::stay, &Ways::follow, &Ways::spread, &Ways::restless, &Ways::first, &Ways::detection);
};

// All arrays must be of one person, and the stretches evidence of as many patches.
inline void check_stays(const Ways& ways, const Stretches& stretches) {
    const i64 rooms = ways.rooms(), patches = ways.patches(), count = stretches.size();
    require(rooms > 0 && patches > 0 && ways.nodes() > 0 && ways.nodes() % rooms == 0,
            "stay must be (rooms * stages,), restless (rooms,), spread (patches,), none of them 0");
    require(ways.follow.size() == ways.nodes() && ways.follow.shape[1] == rooms + 1,
            "follow must be (rooms * stages, rooms + 1)");
    require(ways.first.size() == rooms + 1 && ways.first[0] == 0 && ways.first[rooms] == patches &&
                std::is_sorted(ways.first.begin(), ways.first.end()),
            "first must be (rooms + 1,), ascending from 0 to the number of patches");
    require(stretches.hour.size() == count && stretches.shown.size() == count && stretches.shown.shape[1] == patches &&
                stretches.begin.size() == count + 1 && stretches.patch.size() == stretches.share.size(),
            "stretches must be of one length and of the patches of spread, begin one longer, patch as long as share");
    require(all_in_range(stretches.bins, 1, i64{1} << 31), "bins must be 1 or more");
    require(all_in_range(stretches.begin, 0, stretches.patch.size() + 1), "begin must hold numbers of sightings");
    require(all_in_range(stretches.patch, 0, patches), "patch must hold numbers of patches");
}

}  // namespace fleet2d
