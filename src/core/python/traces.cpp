#include "../traces.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<TracedRooms> = 2;

template <>
inline constexpr std::size_t border::members_of<TracedEvidence> = 6;

template <>
inline constexpr std::size_t border::members_of<PlaceNetwork> = 5;

namespace {

Array<f64, 3> checked_trace_evidence(View<f64> memory, const TracedRooms& home, const TracedEvidence& evidence) {
    const i64 rooms = home.size(), bins = evidence.day.size();
    require(rooms > 0 && home.distance.shape == std::array{rooms, rooms}, "distance must be (rooms, rooms), not empty");
    require(memory.size() == home.state_size(), "memory must have the size that trace_size returns");
    require(memory[0] >= -1 && memory[0] < static_cast<f64>(rooms),
            "memory must begin with the number of a room, or -1");
    const std::array of_rooms{bins, rooms};
    require(evidence.minute.size() == bins && evidence.watched.shape == of_rooms && evidence.seen.shape == of_rooms &&
                evidence.unknown.shape == of_rooms && evidence.belief.shape == std::array{bins, rooms + 1},
            "minute must be (bins,), watched, seen and unknown (bins, rooms), belief (bins, rooms + 1)");
    require(all_in_range(evidence.minute, 0, 1440), "minute must be from 0 to 1439");
    require(all_in_range(evidence.day, 1, i64{1} << 31), "day must be from 1 to 2**31 - 1");
    return trace_evidence(memory, home, evidence);
}

Array<f64, 2> checked_place_probabilities(const PlaceNetwork& network, View<const f64, 2> places,
                                          View<const f64, 3> features) {
    const i64 hidden = network.bias.size();
    const std::array square{hidden, hidden};
    require(network.second.shape == square && network.context.shape == square && network.score.size() == hidden,
            "second and context must be (hidden, hidden), bias and score (hidden,)");
    require(hidden > 0 && network.first.shape == std::array{features.shape[2], hidden},
            "first must be (features, hidden), not empty");
    require(features.shape[2] > 0 && features.shape[1] > 0 && places.shape == std::array{features.shape[1], hidden},
            "places must be (places, hidden), features (bins, places, features), with places and features");
    return place_probabilities(network, places, features);
}

}  // namespace

void bind_traces(nb::module_& m) {
    m.attr("TRACE_FEATURES") = TRACE_FEATURES;
    m.def(
        "trace_size", [](const TracedRooms& home) { return home.state_size(); }, "home"_a,
        "Return the size of the memory of `trace_evidence`.");
    m.def("trace_evidence", &checked_trace_evidence, "memory"_a, "home"_a, "evidence"_a, Unlocked(),
          R"(Add evidence of a person to what it has left behind, and return it as features of each place.

Args:
    memory: float64 (trace_size(home),), zeros before the first bin; it is updated.
    home: The rooms.
    evidence: The evidence of one person in consecutive bins.

Returns:
    float64 (bins, rooms + 1, TRACE_FEATURES), away last.)");
    m.def("place_probabilities", &checked_place_probabilities, "network"_a, "places"_a, "features"_a, Unlocked(),
          R"(Return the probability of each place by a network over the set of places.

Args:
    network: The weights.
    places: float64 (places, hidden), what the first layer makes of what doesn't change.
    features: float64 (bins, places, features), the last one the logarithm of the belief that is corrected.

Returns:
    float64 (bins, places), rows sum to one.)");
}

}  // namespace fleet2d
