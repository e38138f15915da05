// Stays as Python holds them: the named tuples of `fleet2d.kernels`.
#pragma once

#include "../stays.hpp"
#include "arrays.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<Stretches> = 6;

template <>
inline constexpr std::size_t border::members_of<StayModel> = 6;

// All arrays must be of one person.
inline void check_model(const StayModel& model) {
    const i64 rooms = model.rooms(), patches = model.patches();
    require(rooms > 0 && patches > 0 && model.nodes() > 0 && model.nodes() % rooms == 0,
            "stay must be (rooms * stages,), restless (rooms,), spread (patches,), none of them 0");
    require(model.follow.size() == model.nodes() && model.follow.shape[1] == rooms + 1,
            "follow must be (rooms * stages, rooms + 1)");
    require(model.first.size() == rooms + 1 && model.first[0] == 0 && model.first[rooms] == patches &&
                std::is_sorted(model.first.begin(), model.first.end()),
            "first must be (rooms + 1,), ascending from 0 to the number of patches");
}

// The stretches must be evidence of as many patches as a model has.
inline void check_stays(const StayModel& model, const Stretches& stretches) {
    check_model(model);
    const i64 patches = model.patches(), count = stretches.size();
    require(stretches.view.size() == count && stretches.views.shape[1] == patches &&
                stretches.begin.size() == count + 1 && stretches.patch.size() == stretches.share.size(),
            "stretches must be of one length and of the patches of spread, begin one longer, patch as long as share");
    require(all_in_range(stretches.view, 0, stretches.views.size()), "view must hold numbers of views");
    require(all_in_range(stretches.bins, 1, i64{1} << 31), "bins must be 1 or more");
    require(all_in_range(stretches.begin, 0, stretches.patch.size() + 1), "begin must hold numbers of sightings");
    require(all_in_range(stretches.patch, 0, patches), "patch must hold numbers of patches");
}

}  // namespace fleet2d
