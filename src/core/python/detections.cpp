#include "../detections.hpp"

#include <nanobind/stl/vector.h>

#include "../occlusion.hpp"

#include <algorithm>
#include <array>

#include "lens.hpp"
#include "mesh.hpp"
#include "perception.hpp"
#include "subjects.hpp"
#include "timelines.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<SightMemory> = 5;
template <>
inline constexpr std::size_t border::members_of<DetectionRule> = 6;
template <>
inline constexpr std::size_t border::members_of<Heights> = 7;

namespace {

enum class SightingColumn : i64 {};
constexpr i64 IDENTITY_COLUMN = 3;
static_assert(SIGHTING_COLUMNS[IDENTITY_COLUMN].second == &Sighting::identity);

constexpr i64 FARTHEST = 1 << 29;  // squares of distances stay inside 64 bits

void check_window(const Window& window, Onlooker onlooker, i64 users) {
    require(0 <= onlooker.body && onlooker.body < window.bodies(), "there is no such body");
    require(0 <= onlooker.first_other && onlooker.first_other <= window.bodies() - users, "there are fewer others");
    require(all_in_range(window.x, -FARTHEST, FARTHEST) && all_in_range(window.y, -FARTHEST, FARTHEST),
            "bodies must be within 2**29 lattice units");
    require(all_in_range(window.posture, 0, POSTURES), "a posture must be 0, 1 or 2");
    require(0 <= window.first && window.end < LATEST, "steps must be 0 or more");
}

// All moments of a window, and the ends of pans that begin in it, must be numbers above their beginnings.
void check_moments(const DetectionRule& rule, const Window& window, const Lenses& lenses) {
    require(rule.step_us > 0, "step_us must be above 0");
    require(window.end < LATEST / rule.step_us, "steps must begin before 2**61 us");
    require(0 <= rule.start_us && rule.start_us < LATEST, "start_us must be in 0 to 2**61 - 1");
    require(all_in_range(lenses.pan_us, 0, LATEST), "pan_us must be in 0 to 2**61 - 1");
}

// No point may be in view that a body doesn't have.
void check_shown(View<const u64, 3> shown, const Lenses& lenses, const Window& window) {
    require(shown.shape == std::array{lenses.reach.shape[0], lenses.reach.shape[1], window.end - window.first},
            "shown must be (cameras, users, steps)");
    for (i64 camera = 0; camera < shown.size(); ++camera) {
        const u64 points = (u64{1} << (lenses.points[camera] + 1)) - 1;
        for (i64 user = 0; user < shown.shape[1]; ++user) {
            for (const u64 bits : shown[camera][user]) {
                require((bits & ~points) == 0, "shown must be of points that there are");
            }
        }
    }
}

// Column by column, as they are read.
Array<i64, 2> columns_of(const std::vector<Sighting>& sightings) {
    auto columns = Array<i64, 2>::empty({SIGHTING, static_cast<i64>(sightings.size())});
    i64 column = 0;
    for (const auto& [_, member] : SIGHTING_COLUMNS) {
        std::ranges::transform(sightings, columns[column++].begin(), member);
    }
    return columns;
}

void check_heights(const Heights& heights, const Lenses& lenses, i64 bodies) {
    const i64 cameras = lenses.bodies.size(), pieces = heights.pieces();
    require(heights.eyes.shape == std::array{cameras, POSTURES} && heights.tops.shape == std::array{bodies, POSTURES},
            "eyes must be (cameras, POSTURES), tops (bodies, POSTURES)");
    require(heights.points.shape == std::array{cameras, lenses.bodies.shape[1], POSTURES, lenses.bodies.shape[2]},
            "points must be (cameras, users, POSTURES, points + 1)");
    require(all_in_range(heights.eyes, 0, HIGHEST) && all_in_range(heights.points, 0, HIGHEST) &&
                all_in_range(heights.tops, 0, HIGHEST) && all_in_range(heights.top, 0, HIGHEST),
            "heights must be in 0 to 2**13 - 1");
    require(heights.corners.shape[1] == 2 && all_in_range(heights.corners, -FARTHEST, FARTHEST),
            "corners must be (corners, 2), within 2**29 lattice units");
    require(heights.boxes.shape == std::array{pieces, i64{4}} && heights.start.size() == pieces + 1,
            "start must have one more than there are pieces, boxes must be (pieces, 4)");
    require(heights.start[0] == 0 && heights.start[pieces] == heights.corners.size(), "start must cover all corners");
    for (i64 i = 0; i < pieces; ++i) {
        require(heights.start[i] < heights.start[i + 1], "each piece must have corners");
    }
}

void check_memory(const SightMemory& memory, const Lenses& lenses, const ErrorTables& errors, i64 cameras, i64 users) {
    require(memory.noticed.size() == users + 1 && memory.seen.size() == users + 1,
            "noticed and seen must have one length, that of the users and one more");
    require(all_in_range<i64>(memory.noticed, -1, LATEST), "noticed must hold steps, or -1");
    require(all_in_range<i64>(memory.seen, 0, 2), "seen must be 0 or 1");
    require(memory.about.shape == std::array{cameras, users, ABOUT}, "about must be (cameras, users, ABOUT)");
    require(memory.backlog.size() == cameras && memory.backlog.shape[2] == SIGHTING,
            "backlog must be (cameras, rows, SIGHTING)");
    require(memory.waiting.shape == std::array{cameras, i64{2}}, "waiting must be (cameras, 2)");
    const i64 rows = memory.backlog.shape[1];
    for (i64 c = 0; c < cameras; ++c) {
        const i64 burst = users + (errors.has_ghosts[c] != 0 ? MAX_GHOSTS : 0) + errors.injected.size();
        require((lenses.latency[c] / lenses.period[c] + 1) * burst <= rows,
                "backlog must have room for all that waits");
        for (i64 u = 0; u < users; ++u) {
            const i64 identity = at(memory.about[c][u], About::LAST_IDENTITY);
            require(NOBODY <= identity && identity < users, "about must hold numbers of users, or NOBODY");
            const i64 forced = at(memory.about[c][u], About::FORCED);
            require(0 <= forced && forced < users + FORCED_IDENTITY, "FORCED must stand for a user, or for less");
        }
        const i64 begin = memory.waiting(c, 0), length = memory.waiting(c, 1);
        require(0 <= begin && begin < std::max(rows, i64{1}) && 0 <= length && length <= rows,
                "waiting must lie in the backlog");
        for (i64 i = 0; i < length; ++i) {
            const i64 identity = memory.backlog(c, (begin + i) % rows, IDENTITY_COLUMN);
            require(NOBODY <= identity && identity < users, "backlog must hold numbers of users, or NOBODY");
        }
    }
}

}  // namespace

void bind_detections(nb::module_& m) {
    auto columns =
        nb::enum_<SightingColumn>(m, "SightingColumn", nb::is_arithmetic(), R"(The columns of a row of sightings.

STEP is when it becomes known. Where a camera was wrong about a person, USER is NOBODY; where it
didn't recognize one, IDENTITY is. X to POSTURE are as perceived: lattice units, 1/4096 turn, and 0
for standing, 1 sitting, 2 lying.)");
    for (std::size_t i = 0; i < SIGHTING_COLUMNS.size(); ++i) {
        columns.value(SIGHTING_COLUMNS[i].first, static_cast<SightingColumn>(i));
    }
    m.attr("USER_LOST") = static_cast<i64>(SightEvent::LOST);
    m.attr("USER_SEEN") = static_cast<i64>(SightEvent::SEEN);

    m.def(
        "detect",
        [](const Mesh& walls, const Lenses& lenses, const ErrorTables& errors, const DetectionRule& rule,
           const Window& window, i64 body, i64 first_other, const SightMemory& memory,
           std::optional<View<const u64, 3>> shown, std::optional<View<const i64>> radii,
           const std::optional<Heights>& heights) {
            check_lenses(lenses);
            const i64 cameras = lenses.reach.shape[0], users = lenses.reach.shape[1];
            require(lenses.bodies.shape[2] < MAX_SHOWN, "bodies must have fewer than MAX_SHOWN points");
            require(all_in_range(lenses.latency, 0, LATEST), "latency must be 0 or more");
            check_errors(errors, lenses.errs, users);
            check_window(window, {body, first_other}, users);
            check_moments(rule, window, lenses);
            check_memory(memory, lenses, errors, cameras, users);
            const View<const u64, 3> points = shown.value_or(View<const u64, 3>());
            const View<const i64> widths = radii.value_or(View<const i64>());
            if (shown) check_shown(points, lenses, window);
            if (radii) {
                require(widths.size() == window.bodies(), "radii must have one for each body");
                require(all_in_range(widths, 1, FATTEST), "radii must be in 1 to 2**17 - 1");
            }
            if (heights) check_heights(*heights, lenses, window.bodies());
            DetectionResult result;
            {
                const nb::gil_scoped_release unlocked;
                result = detect(walls, lenses, errors, rule, window, {body, first_other}, memory, points, widths,
                                heights ? &*heights : nullptr);
            }
            std::vector<std::tuple<i64, i64, i64>> events;
            for (const auto& [step, identity, kind] : result.events) {
                events.emplace_back(step, identity, static_cast<i64>(kind));
            }
            return std::tuple(result.steps, array_of(result.sighted_at), array_of(result.index),
                              columns_of(result.distinct), std::move(result.newest), std::move(events));
        },
        "walls"_a, "lenses"_a, "errors"_a, "rule"_a, "window"_a, "body"_a, "first_other"_a, "memory"_a,
        "shown"_a = nb::none(), "radii"_a = nb::none(), "heights"_a = nb::none(),
        R"(Look at all others in the steps of a window, up to the first with an event that stops it.

Args:
    walls: The free space.
    lenses: The cameras of a body.
    errors: Their errors.
    rule: The settings that they share.
    window: The motion of all bodies.
    body: Number of the body with the cameras.
    first_other: Number of the first of the others, who are as many as the lenses' users.
    memory: The state of its perception between spans; updated.
    shown: uint64 (cameras, users, steps), which points of each are in view, bit i for number i,
        where another method decides that; None: lines of sight do.
    radii: int64 (bodies,), of all bodies of the window, which hide each other; None: they don't.
    heights: The heights of cameras, bodies and furniture, a `fleet2d.kernels.Heights`; None: they don't matter.

Returns:
    The steps done (the stopping one included); of each sighting the step, int64 (n,), and the number among the
    distinct ones, int32 (n,); these, int64 (SIGHTING, k), with the columns of `SightingColumn` and the step of the
    first; the number of the last sighting of each identity, -1 for none; and the events of identities that came into
    view or were lost, in order of (step, identity): step, identity and kind (USER_SEEN or USER_LOST).

Raises:
    ValueError: Shapes don't agree, or a number is none of a user or camera.)");
}

}  // namespace fleet2d
