#include "../room_memory.hpp"

#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace border {

template <>
inline constexpr std::size_t members_of<RoomMemory> = 3;
template <>
inline constexpr std::size_t members_of<ShownMemory> = 5;

}  // namespace border

namespace {

constexpr i64 LATEST_STEP = i64{1} << 60;

void check(const RoomMemory& memory) {
    const i64 rows = memory.last.shape[0], rooms = memory.last.shape[1];
    require(rows >= 2, "a memory must have rows for people who weren't recognized, and for anyone");
    require(memory.total.shape[0] == rows && memory.total.shape[1] == rooms && memory.looks.shape[0] == rows &&
                memory.looks.shape[1] == rooms && memory.looks.shape[2] == HOURS_OF_DAY,
            "last and total must be (people + 2, rooms), looks (people + 2, rooms, 24)");
}

}  // namespace

void bind_room_memory(nb::module_& m) {
    m.def(
        "remember",
        [](View<const i64> step, View<const i32> index, View<const i64> identity, View<const i16> room, i64 start_us,
           i64 step_us, const RoomMemory& memory) {
            check(memory);
            require(index.size() == step.size() && identity.size() == room.size(),
                    "step and index must have one length, identity and room, too");
            require(all_in_range(index, 0, room.size()), "index must hold numbers of sightings that differ");
            require(all_in_range(identity, -1, memory.last.size() - 2), "there is no such person");
            require(all_in_range(room, INT16_MIN, memory.last.shape[1]), "there is no such room");
            require(
                step_us > 0 && start_us >= 0 && start_us <= LATEST_STEP && all_in_range(step, 0, LATEST_STEP / step_us),
                "times must be from 0 to 2**60 us");
            remember(step, index, identity, room, start_us, step_us, memory);
        },
        "step"_a, "index"_a, "identity"_a, "room"_a, "start_us"_a, "step_us"_a, "memory"_a,
        R"(Add sightings to a memory.

Args:
    step: int64 (n,), when.
    index: int32 (n,), the number of each among those that differ not only in the step.
    identity: int64 (m,), whom the robot saw in each of these; -1: somebody whom it didn't recognize.
    room: int16 (m,), where; below 0 for no room: these are left out.
    start_us: Time of day at step 0 [us].
    step_us: Length of a step [us].
    memory: The `RoomMemory`, which changes.)");
    m.def(
        "show_memory",
        [](const RoomMemory& memory, const ShownMemory& shown, View<const i64> visited, i64 step, i64 hour, f64 step_s,
           const std::vector<f64>& common, View<f32, 2> table) {
            check(memory);
            const i64 rows = memory.last.size();
            require(visited.size() == memory.last.shape[1] && visited.size() <= table.size(),
                    "visited must have each room of the memory, and the table a row for each");
            require(shown.fresh_rows.size() == shown.fresh_at.size() &&
                        shown.fresh_rows.size() == shown.scale_s.size() &&
                        shown.habit_rows.size() == shown.habit_at.size(),
                    "rows, columns and scales must have one length");
            require(all_in_range(shown.fresh_rows, -1, rows) && all_in_range(shown.habit_rows, 0, rows) &&
                        all_in_range(shown.fresh_at, 0, table.shape[1]) &&
                        all_in_range(shown.habit_at, 0, table.shape[1]),
                    "there is no such row or column");
            require(0 <= hour && hour < HOURS_OF_DAY, "hour must be 0 to 23");
            require(0 <= step && step < LATEST_STEP, "step must be from 0 to 2**60");
            require(static_cast<i64>(common.size()) <= table.shape[1], "the table has fewer columns than common");
            show_memory(memory, shown, visited, step, hour, step_s, common, table);
        },
        "memory"_a, "shown"_a, "visited"_a, "step"_a, "hour"_a, "step_s"_a, "common"_a, "table"_a,
        R"(Fill the columns of an observation that show a memory, and those that all rows have in common.

Args:
    memory: The `RoomMemory`.
    shown: What it shows, `ShownMemory`.
    visited: int64 (rooms,), the step at which the robot last went to each room; -1: never.
    step: The present step.
    hour: The present hour of the day.
    step_s: Length of a step [s].
    common: The values of the last columns, the same in all rows.
    table: float32 (rows, columns), the observation, which changes; its first rows are the rooms.)");
}

}  // namespace fleet2d
