#include "../battery.hpp"

#include "motion.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<BatteryState> = 8;

namespace {

void check(const Breakpoints& track, const BatteryState& battery) {
    require(is_traceable(track),
            "the times of a track must ascend, its arrays have one length, and all its numbers be small enough");
    require(0 <= battery.level && battery.level <= 1, "level must be 0 to 1");
    require(-LATEST <= battery.since_us && battery.since_us <= LATEST, "since_us must be at most 2**61");
    const auto is_rate = [](f64 rate) { return 1e-18 < rate && rate <= 1; };  // a moment of a level fits in 64 bits
    require(is_rate(-battery.driving) && is_rate(-battery.standing) && is_rate(battery.charging),
            "driving and standing must be below 0, charging above it, by at most 1 a microsecond");
}

}  // namespace

void bind_battery(nb::module_& m) {
    m.def(
        "charge_pieces",
        [](const Breakpoints& track, const BatteryState& battery) {
            check(track, battery);
            const std::vector<ChargePiece> pieces = charge_pieces(track, battery);
            const auto size = static_cast<i64>(pieces.size());
            auto begins = Array<i64>::empty({size});
            auto levels = Array<f64>::empty({size}), rates = Array<f64>::empty({size});
            for (i64 i = 0; i < size; ++i) {
                const ChargePiece& piece = pieces[static_cast<std::size_t>(i)];
                begins[i] = piece.begin_us, levels[i] = piece.level, rates[i] = piece.rate;
            }
            return std::tuple(std::move(begins), std::move(levels), std::move(rates));
        },
        "track"_a, "battery"_a,
        R"(Return the charge of a battery while a body follows a track.

Args:
    track: The track; without breakpoints, the body drives for good.
    battery: The battery, a `BatteryState`.

Returns:
    The moments at which the rate of the charge changes [us], int64 (n,), the charge at each, float64 (n,), and the
    rate from each on [1/us], float64 (n,).)");
    m.def(
        "charge_at",
        [](const Breakpoints& track, const BatteryState& battery, i64 moment_us) {
            check(track, battery);
            require(battery.since_us <= moment_us && moment_us <= LATEST,
                    "the moment must not be before that of the battery, and 2**61 at most");
            return charge_at(track, battery, moment_us);
        },
        "track"_a, "battery"_a, "moment_us"_a, "Return the charge, 0 to 1, at a moment of a track [us].");
    m.def(
        "charge_falls_to",
        [](const Breakpoints& track, const BatteryState& battery, f64 level) {
            check(track, battery);
            require(0 <= level && level <= 1, "level must be 0 to 1");
            return charge_falls_to(track, battery, level);
        },
        "track"_a, "battery"_a, "level"_a,
        "Return the moment of a track at which the charge has fallen to a level [us]; None if it never does.");
}

}  // namespace fleet2d
