// Error tables as Python holds them: the named tuple `fleet2d.kernels.ErrorTables`.
#pragma once

#include "../perception.hpp"
#include "arrays.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<ErrorTables> = 10;

// A camera's table as far as it decides where another entry is read.
inline void check_table(View<const i64> table) {
    require(table.size() == TABLE, "a camera's table must have TABLE entries");
    require(0 <= table[SHIFT] && table[SHIFT] < 63, "the entry SHIFT of a camera's table must be 0 to 62");
}

// All arrays must be of one set of cameras and users. Tables are only read for a camera that errs.
inline void check_errors(const ErrorTables& errors, View<const i64> errs, i64 users) {
    const i64 cameras = errs.size(), sources = errors.source.shape[1];
    for (const i64 length : {errors.table.size(), errors.confusion.size(), errors.has_ghosts.size(),
                             errors.ghosts.size(), errors.source.size(), errors.spot.size(), errors.looks_like.size(),
                             errors.keys.size(), errors.ghost_keys.size()}) {
        require(length == cameras, "all arrays of error tables must have one length, that of the cameras");
    }
    require(errors.confusion.shape[1] == users && errors.confusion.shape[2] == users && errors.keys.shape[1] == users &&
                errors.looks_like.shape[1] == users + 1,
            "confusion must be (cameras, users, users), keys (cameras, users, draws), looks_like (cameras, users + 1)");
    require(errors.keys.shape[2] == USER_DRAWS && errors.ghost_keys.shape[1] == GHOST_DRAWS,
            "keys and ghost_keys must have an entry for each draw");
    require(errors.ghosts.shape[1] == MAX_GHOSTS, "ghosts must be (cameras, MAX_GHOSTS)");
    require(sources > 0 && errors.spot.shape[1] == sources && errors.spot.shape[2] == 3,
            "source must be (cameras, sources), spot (cameras, sources, 3)");
    require(errors.injected.shape[1] == INJECTED, "injected must be (n, INJECTED)");
    for (i64 i = 0; i < errors.injected.size(); ++i) {
        const i64 camera = errors.injected(i, 0), identity = errors.injected(i, 1);
        require(0 <= camera && camera < cameras, "injected must hold numbers of cameras");
        require(NOBODY <= identity && identity < users, "injected must hold numbers of users, or NOBODY");
    }
    for (i64 c = 0; c < cameras; ++c) {
        require(errors.source(c, sources - 1) >= ONE, "source must end at ONE");
        if (errs[c] != 0) check_table(errors.table[c]);
    }
}

}  // namespace fleet2d
