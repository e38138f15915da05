// When people use rooms that only one person can use at a time.
//
// Times are seconds since the midnight of a day, rooms are numbers.
#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "array.hpp"

namespace fleet2d {

inline constexpr i64 ANY_ROOM = -1;  // the room of what needs none for itself, or of a home whose rooms are unknown

struct FreeSlot {
    i64 begin, end, room;
};

class RoomUse {
public:
    void add(i64 room, i64 begin, i64 end) {
        std::vector<Span>& spans = spans_[room];
        const Span span{begin, end};
        spans.insert(std::upper_bound(spans.begin(), spans.end(), span), span);
    }

    // The first time from `begin` to `latest` from which one of the rooms is free for `shortest` seconds. It lasts
    // until the next use of the room, or until `end_by`. Of rooms that are free at once, the first.
    std::optional<FreeSlot> free(const std::vector<i64>& rooms, i64 begin, i64 latest, i64 shortest, i64 end_by) const {
        std::optional<FreeSlot> best;
        for (const i64 room : rooms) {
            const std::optional<Span> slot = free_in(room, begin, latest, shortest, end_by);
            if (slot && (!best || slot->first < best->begin)) best = {slot->first, slot->second, room};
        }
        return best;
    }

private:
    using Span = std::pair<i64, i64>;  // begin and end

    std::optional<Span> free_in(i64 room, i64 begin, i64 latest, i64 shortest, i64 end_by) const {
        if (const auto spans = spans_.find(room); spans != spans_.end()) {
            for (const auto& [first, last] : spans->second) {
                if (last <= begin) continue;
                if (begin > latest) return std::nullopt;
                if (begin + shortest <= first) return Span{begin, std::min(end_by, first)};
                begin = last;
            }
        }
        return begin <= latest ? std::optional(Span{begin, end_by}) : std::nullopt;
    }

    std::map<i64, std::vector<Span>> spans_;  // of each room, in order of time
};

// What one person needs to know of the others' use of rooms.
struct PrivateRooms {
    const RoomUse& use;
    // The rooms where each job of a plan, or each activity, is done alone, the preferred one first; none: it isn't.
    const std::vector<std::vector<i64>>& rooms;
};

}  // namespace fleet2d
