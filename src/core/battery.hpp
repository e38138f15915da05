// The charge of a robot's battery while it follows a track: it changes at one of three constant rates.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "motion.hpp"

namespace fleet2d {

// A battery at a moment.
struct BatteryState {
    f64 level;     // its charge, 0 to 1
    i64 since_us;  // the moment
    f64 driving;   // the rates of its charge [1/us]: driving or turning,
    f64 standing;  // standing still,
    f64 charging;  // and standing or turning at the charger
    i64 charger_x;
    i64 charger_y;
    bool is_broken;  // whether the charger doesn't charge
};

// A charge that changes at one rate from a moment on.
struct ChargePiece {
    i64 begin_us;
    f64 level;
    f64 rate;  // 1/us
};

// Call `visit(piece, end_us)` for the pieces of the charge from a moment on, up to the first for which it returns
// false; `end_us` is empty for the last one. A body with a track without breakpoints never stands still.
template <class Visit>
void visit_charge(const Breakpoints& track, const BatteryState& battery, Visit visit) {
    const i64 size = track.size();
    if (size == 0) {
        visit(ChargePiece{battery.since_us, battery.level, battery.driving}, std::optional<i64>());
        return;
    }
    f64 level = battery.level;
    for (i64 i = last_breakpoint(track.time, battery.since_us); i < size; ++i) {
        const bool is_last = i + 1 == size;
        const bool stays = is_last || (track.x[i + 1] == track.x[i] && track.y[i + 1] == track.y[i]);
        const bool stands = is_last || (stays && track.heading[i + 1] == track.heading[i]);
        const bool is_docked = stays && track.x[i] == battery.charger_x && track.y[i] == battery.charger_y;
        const f64 rate = is_docked && !battery.is_broken ? battery.charging
                         : stands                        ? battery.standing
                                                         : battery.driving;
        const i64 begin = std::max(track.time[i], battery.since_us);
        const std::optional<i64> end =
            is_last ? std::nullopt : std::optional(std::max(track.time[i + 1], battery.since_us));
        if (!visit(ChargePiece{begin, level, rate}, end)) return;
        if (end) level = std::clamp(level + rate * static_cast<f64>(*end - begin), 0.0, 1.0);
    }
}

// The pieces of the charge from the moment of the battery on.
inline std::vector<ChargePiece> charge_pieces(const Breakpoints& track, const BatteryState& battery) {
    std::vector<ChargePiece> pieces;
    visit_charge(track, battery, [&](const ChargePiece& piece, std::optional<i64>) {
        pieces.push_back(piece);
        return true;
    });
    return pieces;
}

// The charge at a moment, which isn't before that of the battery.
inline f64 charge_at(const Breakpoints& track, const BatteryState& battery, i64 moment_us) {
    f64 charge = battery.level;
    visit_charge(track, battery, [&](const ChargePiece& piece, std::optional<i64> end) {
        const i64 since = std::max<i64>(moment_us - piece.begin_us, 0);
        charge = std::clamp(piece.level + piece.rate * static_cast<f64>(since), 0.0, 1.0);
        return end && *end <= moment_us;
    });
    return charge;
}

// The first microsecond at which the charge has fallen to a level; none if it never does.
inline std::optional<i64> charge_falls_to(const Breakpoints& track, const BatteryState& battery, f64 level) {
    std::optional<i64> moment;
    visit_charge(track, battery, [&](const ChargePiece& piece, std::optional<i64> end) {
        if (piece.level <= level) {
            moment = piece.begin_us;
        } else if (piece.rate < 0 &&
                   (!end || piece.level + piece.rate * static_cast<f64>(*end - piece.begin_us) <= level)) {
            moment = piece.begin_us + static_cast<i64>((piece.level - level) / -piece.rate) + 1;
        }
        return !moment;
    });
    return moment;
}

}  // namespace fleet2d
