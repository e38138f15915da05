// When and where a robot perceived people, and what an observation of a learned policy shows of it.
#pragma once

#include <algorithm>
#include <vector>

#include "array.hpp"

namespace fleet2d {

using f32 = float;

inline constexpr i64 HOURS_OF_DAY = 24;
inline constexpr i64 US_PER_HOUR = 3'600'000'000;

// Sightings of people, in the rooms where they were perceived. The last row but one is of people who weren't
// recognized, the last of anyone.
struct RoomMemory {
    View<i64, 2> last;   // (people + 2, rooms) the step of the last sighting; -1: none
    View<i64, 3> looks;  // (people + 2, rooms, 24) their number in each hour of the day
    View<i64, 2> total;  // (people + 2, rooms) their number
};

// Add sightings to a memory: their steps, and of each the number of what was seen: whom (-1: not recognized), and the
// room, below 0 for none. `start_us` is the time of day at step 0.
inline void remember(View<const i64> step, View<const i32> index, View<const i64> identity, View<const i16> room,
                     i64 start_us, i64 step_us, const RoomMemory& memory) {
    const i64 anyone = memory.last.size() - 1;
    for (i64 k = 0; k < step.size();) {
        // Those that repeat this one within the hour are added at once.
        const i64 first = k, at = room[index[k]];
        const i64 hours = (start_us + step[k] * step_us) / US_PER_HOUR;
        const i64 until = ((hours + 1) * US_PER_HOUR - start_us + step_us - 1) / step_us;
        i64 last = step[k];
        for (; k < step.size() && index[k] == index[first] && step[k] >= step[first] && step[k] < until; ++k) {
            last = std::max(last, step[k]);
        }
        if (at < 0) continue;
        const i64 who = identity[index[first]];
        for (const i64 row : {who < 0 ? anyone - 1 : who, anyone}) {
            memory.last(row, at) = std::max(memory.last(row, at), last);
            memory.looks(row, at, hours % HOURS_OF_DAY) += k - first;
            memory.total(row, at) += k - first;
        }
    }
}

// Which rows of a memory an observation shows, and in which of its columns.
struct ShownMemory {
    View<const i64> fresh_rows;  // (n,) rows of `last`; -1: the robot's own visits
    View<const i64> fresh_at;    // (n,) their columns
    View<const f64> scale_s;     // (n,) what happened this long ago counts half
    View<const i64> habit_rows;  // (m,) the first is a row of `total`, the others are rows of `looks`
    View<const i64> habit_at;    // (m,) their columns
};

// Fill the columns of an observation (rows, columns) that show a memory at a step, in an hour of the day.
//
// `visited` has the step at which the robot last went to each room, -1 for never; the rooms come first in the table.
// `common` are the values of the last columns, which are the same in all rows.
inline void show_memory(const RoomMemory& memory, const ShownMemory& shown, View<const i64> visited, i64 step, i64 hour,
                        f64 step_s, const std::vector<f64>& common, View<f32, 2> table) {
    const i64 rooms = visited.size();
    for (i64 k = 0; k < shown.fresh_rows.size(); ++k) {
        const i64 row = shown.fresh_rows[k], column = shown.fresh_at[k];
        const f64 scale_s = shown.scale_s[k];
        for (i64 room = 0; room < rooms; ++room) {
            const i64 last = row < 0 ? visited[room] : memory.last(row, room);
            const f64 age_s = static_cast<f64>(step - last) * step_s;
            table(room, column) = last < 0 ? 0.0F : static_cast<f32>(scale_s / (scale_s + age_s));
        }
    }
    for (i64 k = 0; k < shown.habit_rows.size(); ++k) {
        const i64 row = shown.habit_rows[k], column = shown.habit_at[k];
        const auto looks = [&](i64 room) { return k == 0 ? memory.total(row, room) : memory.looks(row, room, hour); };
        i64 sum = 0;
        for (i64 room = 0; room < rooms; ++room) sum += looks(room);
        const f64 all = static_cast<f64>(std::max<i64>(sum, 1));
        for (i64 room = 0; room < rooms; ++room) {
            table(room, column) = static_cast<f32>(static_cast<f64>(looks(room)) / all);
        }
    }
    const i64 first = table.shape[1] - static_cast<i64>(common.size());
    for (i64 row = 0; row < table.size(); ++row) {
        for (std::size_t k = 0; k < common.size(); ++k) {
            table(row, first + static_cast<i64>(k)) = static_cast<f32>(common[k]);
        }
    }
}

}  // namespace fleet2d
