#include "perception.hpp"

#include "subjects.hpp"

namespace fleet2d {
namespace {

enum class TablePart : i64 {};

// The table of one of the cameras.
View<const i64> table_of(View<const i64, 2> tables, i64 camera) {
    require(0 <= camera && camera < tables.size(), "there is no such camera");
    check_table(tables[camera]);
    return tables[camera];
}

// Squares of distances stay inside 64 bits.
void check_offset(i64 dx, i64 dy) {
    constexpr i64 most = i64{1} << 30;
    require(-most <= dx && dx <= most && -most <= dy && dy <= most, "dx and dy must be within 2**30 lattice units");
}

}  // namespace

void bind_perception(nb::module_& m) {
    m.attr("ONE") = ONE;
    m.attr("POSTURES") = POSTURES;
    m.attr("MINUTES") = MINUTES;
    m.attr("DOUBLINGS") = DOUBLINGS;
    m.attr("MAX_GHOSTS") = MAX_GHOSTS;
    m.attr("NOBODY") = NOBODY;
    m.attr("BINS") = BINS;
    m.attr("TABLE") = TABLE;
    nb::enum_<TablePart>(m, "TablePart", nb::is_arithmetic(), "The first entry of each part of a camera's table.")
        .value("DISTANCE", TablePart{AT_DISTANCE}, "Factor to notice a user, by bin of the distance [2**-31].")
        .value("BEARING", TablePart{AT_BEARING}, "By 1/4096 turn left of the optical axis, + HALF_TURN.")
        .value("FACING", TablePart{AT_FACING}, "By how far the user is turned away from the camera.")
        .value("POSTURE", TablePart{AT_POSTURE}, "By the user's posture.")
        .value("SHOWN", TablePart{AT_SHOWN}, "By the number of the body's points in view.")
        .value("LIGHT", TablePart{AT_LIGHT}, "By the minute of the day.")
        .value("STAY", TablePart{AT_STAY}, "That attention outlasts 2**i steps.")
        .value("RIGHT", TablePart{AT_RIGHT}, "That a user is recognized, by bin of the distance.")
        .value("MISTAKEN", TablePart{AT_MISTAKEN}, "That a user is mistaken for another one, likewise.")
        .value("SEEMS", TablePart{AT_SEEMS}, "The perceived posture by the true one, cumulative.")
        .value("SHIFT", TablePart{SHIFT}, "A distance of d lattice units is in bin d >> SHIFT.")
        .value("KEEPS", TablePart{KEEPS}, "1 if an identity lasts as long as the user is tracked.")
        .value("RANGE_NOISE", TablePart{RANGE_NOISE}, "2**-16 lattice units per unit of random_bell.")
        .value("RANGE_SHARE", TablePart{RANGE_SHARE}, "The same per lattice unit of distance, times 2**16.")
        .value("BEARING_NOISE", TablePart{BEARING_NOISE}, "2**-16 / 8192 of a turn per unit of random_bell.")
        .value("HEADING_NOISE", TablePart{HEADING_NOISE}, "2**-16 headings per unit of random_bell.");

    nb::enum_<UserDraw>(m, "UserDraw", nb::is_arithmetic(),
                        "What each draw about one user decides: the last axis of `ErrorTables.keys`.")
        .value("DETECT", UserDraw::DETECT, "Whether a user in view is noticed.")
        .value("ATTEND", UserDraw::ATTEND, "Whether the last draw still holds.")
        .value("IDENTIFY", UserDraw::IDENTIFY, "Whether a user is recognized, mistaken for another one, or unknown.")
        .value("MISTAKE", UserDraw::MISTAKE, "Which other user a user is mistaken for.")
        .value("RANGE", UserDraw::RANGE, "Error of the distance.")
        .value("BEARING", UserDraw::BEARING, "Error of the direction from the camera.")
        .value("HEADING", UserDraw::HEADING, "Error of the user's heading.")
        .value("POSTURE", UserDraw::POSTURE, "Which posture is perceived.");
    nb::enum_<GhostDraw>(m, "GhostDraw", nb::is_arithmetic(),
                         "What each draw about false positives decides: the last axis of `ErrorTables.ghost_keys`.")
        .value("COUNT", GhostDraw::COUNT, "Their number in a look.")
        .value("SOURCE", GhostDraw::SOURCE, "The source of one.")
        .value("PLACE", GhostDraw::PLACE, "Its position.")
        .value("IDENTITY", GhostDraw::IDENTITY, "Which user it looks like.")
        .value("HEADING", GhostDraw::HEADING, "Its heading.");
    nb::enum_<About>(m, "About", nb::is_arithmetic(),
                     "What a camera stores about one user: the last axis of `SightMemory.about`.")
        .value("DRAW", About::DRAW, "The latest draw of UserDraw.DETECT [2**-53].")
        .value("DRAW_STEP", About::DRAW_STEP, "The last step at which the user was in view; -1: never.")
        .value("LAST_IDENTITY", About::LAST_IDENTITY, "The identity at the last sighting, or NOBODY.")
        .value("TRACK_STEP", About::TRACK_STEP, "The last step at which the user was noticed; -1: never.")
        .value("IN_VIEW", About::IN_VIEW, "Looks at which the user was in view.")
        .value("NOTICED", About::NOTICED, "Looks at which the user was noticed.")
        .value("FORCED", About::FORCED,
               "What an intervention makes of a user in view: 0 nothing, FORCED_MISS, or FORCED_IDENTITY + identity.");
    m.attr("FORCED_MISS") = FORCED_MISS;
    m.attr("FORCED_IDENTITY") = FORCED_IDENTITY;

    m.def("random_share", &random_share, "key"_a, "counter"_a, "Return an integer in [0, ONE).");
    m.def(
        "random_shares",
        [](u64 key, View<const i64> counters) {
            auto shares = Array<i64>::empty({counters.size()});
            for (i64 i = 0; i < counters.size(); ++i) shares[i] = random_share(key, counters[i]);
            return shares;
        },
        "key"_a, "counters"_a, Unlocked(), "Return the integer in [0, ONE) of each counter, int64 (n,).");
    m.def("pick", &pick, "cumulative"_a, "draw"_a,
          R"(Return the first outcome whose cumulative probability is above `draw`; their number if none.

Example:
    >>> pick(np.array([ONE // 2, ONE]), ONE // 2)
    1)");
    m.def(
        "length",
        [](i64 dx, i64 dy) {
            check_offset(dx, dy);
            return length(dx, dy);
        },
        "dx"_a, "dy"_a, "Return the length of (dx, dy) [lattice units], rounded down.");
    m.def(
        "distance_bin",
        [](View<const i64, 2> table, i64 camera, i64 dx, i64 dy) {
            check_offset(dx, dy);
            return distance_bin(table_of(table, camera), dx, dy);
        },
        "table"_a, "camera"_a, "dx"_a, "dy"_a, "Return the bin of (dx, dy) in the tables by distance.");
    m.def(
        "persistence_chance",
        [](View<const i64, 2> table, i64 camera, i64 steps) {
            require(steps < i64{1} << DOUBLINGS, "steps must be below 2**62");
            return persistence_chance(table_of(table, camera), steps);
        },
        "table"_a, "camera"_a, "steps"_a, "Return the probability that attention outlasts `steps`.");
    m.def(
        "steady_chance",
        [](View<const i64, 2> table, i64 camera, i64 heading, i64 dx, i64 dy, i64 faces, i64 posture, i64 shown) {
            require(0 <= posture && posture < POSTURES, "there is no such posture");
            require(0 <= shown && shown < MAX_SHOWN, "shown must be below MAX_SHOWN");
            check_offset(dx, dy);
            return steady_chance(table_of(table, camera), heading, dx, dy, faces, posture, shown);
        },
        "table"_a, "camera"_a, "heading"_a, "dx"_a, "dy"_a, "faces"_a, "posture"_a, "shown"_a,
        R"(Return the product of all factors but light [2**-31] for a user at (dx, dy) from the camera.

Args:
    table: The cameras' tables, int64 (cameras, TABLE).
    camera: Which camera.
    heading: Its heading [1/4096 turn].
    dx: Position of the user relative to the camera [lattice units].
    dy: The same.
    faces: Heading of the user [1/4096 turn].
    posture: 0 stands, 1 sits, 2 lies.
    shown: Number of points of the body in view.)");
    m.def("notice_chance", &notice_chance, "steady"_a, "light"_a, "chance"_a,
          "Return the probability to notice [2**-53], from [2**-31], [2**-31] and the camera's own [2**-53].");
    m.def(
        "turn_and_stretch",
        [](i64 dx, i64 dy, i64 turn, i64 distance, i64 target_length) {
            check_offset(dx, dy);
            require(0 < distance && distance < (i64{1} << 40), "distance must be in 1 to 2**40 - 1");
            require(0 <= target_length && target_length < (i64{1} << 21), "target_length must be in 0 to 2**21 - 1");
            const Offset offset = turn_and_stretch(dx, dy, turn, distance, target_length);
            return std::tuple(offset.dx, offset.dy);
        },
        "dx"_a, "dy"_a, "turn"_a, "distance"_a, "target_length"_a,
        "Return (dx, dy), `distance` long, turned by `turn`/8192 of a turn and stretched to the length "
        "`target_length`.");
    m.def(
        "perceived_offset",
        [](View<const i64, 2> table, View<const u64, 3> keys, i64 camera, i64 user, i64 now, i64 dx, i64 dy) {
            require(0 <= camera && camera < keys.size(), "there is no such camera");
            require(0 <= user && user < keys.shape[1] && keys.shape[2] == USER_DRAWS, "there is no such user");
            check_offset(dx, dy);
            const Offset offset = perceived_offset(table_of(table, camera), keys[camera][user], now, dx, dy);
            return std::tuple(offset.dx, offset.dy);
        },
        "table"_a, "keys"_a, "camera"_a, "user"_a, "now"_a, "dx"_a, "dy"_a,
        "Return the perceived position of a user at (dx, dy), relative to the camera.");
    m.def(
        "perceived_posture",
        [](View<const i64, 2> table, i64 camera, i64 posture, i64 draw) {
            require(0 <= posture && posture < POSTURES, "there is no such posture");
            return perceived_posture(table_of(table, camera), posture, draw);
        },
        "table"_a, "camera"_a, "posture"_a, "draw"_a, "Return the perceived posture for a true one, by a random draw.");
}

}  // namespace fleet2d
