// How a camera errs: misses, mistaken identities, noise, and people that aren't there.
//
// Probabilities are integers in units of 2**-31, read from tables that set-up has filled, so that
// every draw is a comparison of integers: the same on every machine.
#pragma once

#include "headings.hpp"
#include "mesh.hpp"
#include "random.hpp"

namespace fleet2d {

inline constexpr i64 BITS = 31;
inline constexpr i64 ONE = i64{1} << BITS;  // probability 1
inline constexpr i64 POSTURES = 3;          // stand, sit, lie
inline constexpr i64 MINUTES = 24 * 60;     // of a day
inline constexpr i64 DOUBLINGS = 62;
inline constexpr i64 MAX_GHOSTS = 20;  // in one look; more are too unlikely to have a probability
inline constexpr i64 NOBODY = -1;      // the user behind a false positive; the identity of an unknown person

// What each draw about one user decides. Every entry has a random stream of its own.
enum class UserDraw : i64 {
    DETECT,    // whether a user in view is noticed
    ATTEND,    // whether the last draw still holds
    IDENTIFY,  // whether a user is recognized, mistaken for another one, or unknown
    MISTAKE,   // which other user a user is mistaken for
    RANGE,     // error of the distance
    BEARING,   // error of the direction from the camera
    HEADING,   // error of the user's heading
    POSTURE,   // which posture is perceived
};
inline constexpr i64 USER_DRAWS = static_cast<i64>(UserDraw::POSTURE) + 1;

// What each draw about false positives decides. Every entry has a random stream of its own.
enum class GhostDraw : i64 {
    COUNT,     // how many there are in a look
    SOURCE,    // the source of one
    PLACE,     // its position
    IDENTITY,  // which user it looks like
    HEADING,   // its heading
};
inline constexpr i64 GHOST_DRAWS = static_cast<i64>(GhostDraw::HEADING) + 1;

// The parts of a camera's table, by their first entry.
inline constexpr i64 BINS = 512;       // of a part by distance
inline constexpr i64 MAX_SHOWN = 34;   // numbers of a body's points that may be in view, 0 included
inline constexpr i64 AT_DISTANCE = 0;  // factors of the probability to notice a user, by bin of the distance
inline constexpr i64 AT_BEARING = AT_DISTANCE + BINS;  // by 1/4096 turn left of the optical axis, + HALF_TURN
inline constexpr i64 AT_FACING = AT_BEARING + TURN;    // by how far the user is turned away from the camera
inline constexpr i64 AT_POSTURE = AT_FACING + HALF_TURN + 1;
inline constexpr i64 AT_SHOWN = AT_POSTURE + POSTURES;        // by the number of the body's points in view
inline constexpr i64 AT_LIGHT = AT_SHOWN + MAX_SHOWN;         // by the minute of the day
inline constexpr i64 AT_STAY = AT_LIGHT + MINUTES;            // that attention outlasts 2**i steps
inline constexpr i64 AT_RIGHT = AT_STAY + DOUBLINGS;          // that a user is recognized, by bin of the distance
inline constexpr i64 AT_MISTAKEN = AT_RIGHT + BINS;           // that a user is mistaken for another one, likewise
inline constexpr i64 AT_SEEMS = AT_MISTAKEN + BINS;           // perceived posture by true one, cumulative
inline constexpr i64 SHIFT = AT_SEEMS + POSTURES * POSTURES;  // a distance of d lattice units is in bin d >> shift
inline constexpr i64 KEEPS = SHIFT + 1;                       // 1 if an identity lasts as long as the user is tracked
inline constexpr i64 RANGE_NOISE = SHIFT + 2;                 // 2**-16 lattice units per unit of random_bell
inline constexpr i64 RANGE_SHARE = SHIFT + 3;                 // the same per lattice unit of distance, times 2**16
inline constexpr i64 BEARING_NOISE = SHIFT + 4;               // 2**-16 / 8192 of a turn per unit of random_bell
inline constexpr i64 HEADING_NOISE = SHIFT + 5;               // 2**-16 headings per unit of random_bell
inline constexpr i64 TABLE = SHIFT + 6;

// How the cameras of one robot err. The first axis of every array is the camera.
// "Cumulative" tables hold in entry i the probability of all outcomes up to i.
struct ErrorTables {
    View<const i64, 2> table;       // (cameras, TABLE)
    View<const i64, 3> confusion;   // (cameras, users, users): which user one is mistaken for, cumulative
    View<const i64> has_ghosts;     // (cameras,): 1 if there are false positives
    View<const i64, 2> ghosts;      // (cameras, MAX_GHOSTS): how many in one look, of all sources, cumulative
    View<const i64, 2> source;      // (cameras, sources): which source one is of, cumulative
    View<const i64, 3> spot;        // (cameras, sources, 3): x, y, noise as RANGE_NOISE; source 0 has none
    View<const i64, 2> looks_like;  // (cameras, users + 1): identity of a false positive, nobody last, cumulative
    View<const u64, 3> keys;        // (cameras, users, USER_DRAWS): streams
    View<const u64, 2> ghost_keys;  // (cameras, GHOST_DRAWS): streams
    View<const i64, 2> injected;    // (n, INJECTED): false positives in every look of a camera, wherever it looks
};

// What a camera stores about one user from look to look: columns of `SightMemory::about`.
enum class About : i64 {
    DRAW,           // the latest draw of UserDraw::DETECT [2**-53]
    DRAW_STEP,      // the last step at which the user was in view; -1: never
    LAST_IDENTITY,  // the identity at the last sighting, or NOBODY
    TRACK_STEP,     // the last step at which the user was noticed; -1: never
    IN_VIEW,        // looks at which the user was in view
    NOTICED,        // looks at which the user was noticed
    FORCED,         // what an intervention makes of a user in view: 0 for nothing, or one of the constants below
};
inline constexpr i64 ABOUT = static_cast<i64>(About::FORCED) + 1;

inline constexpr i64 FORCED_MISS = 1;      // in view, and not noticed
inline constexpr i64 FORCED_IDENTITY = 3;  // recognized as identity 0, and so on; one less: as an unknown person

// The columns of a row of `ErrorTables::injected`.
enum class Injected : i64 { CAMERA, IDENTITY, X, Y, HEADING };
inline constexpr i64 INJECTED = static_cast<i64>(Injected::HEADING) + 1;

inline i64& at(View<i64> about, About column) { return about[static_cast<i64>(column)]; }
inline u64 stream(View<const u64> keys, UserDraw draw) { return keys[static_cast<i64>(draw)]; }
inline u64 stream(View<const u64> keys, GhostDraw draw) { return keys[static_cast<i64>(draw)]; }

// An integer in [0, 2**53).
constexpr i64 random_chance(u64 key, i64 counter) {
    return static_cast<i64>(random_bits(key, static_cast<u64>(counter)) >> 11);
}

// An integer in [0, ONE).
constexpr i64 random_share(u64 key, i64 counter) {
    return static_cast<i64>(random_bits(key, static_cast<u64>(counter)) >> (64 - BITS));
}

// A bell-shaped integer; `noise` is 2**-16 per unit of random_bell.
constexpr i64 random_noise(u64 key, i64 counter, i64 noise) {
    return (random_bell(key, static_cast<u64>(counter)) * noise + 32768) >> 16;
}

// The product of two probabilities.
constexpr i64 product(i64 a, i64 b) { return (a * b) >> BITS; }

// The first outcome whose cumulative probability is above `draw`; their number if none.
inline i64 pick(View<const i64> cumulative, i64 draw) {
    i64 outcome = 0;
    while (outcome < cumulative.size() && draw >= cumulative[outcome]) ++outcome;
    return outcome;
}

// The length of (dx, dy) [lattice units], rounded down.
inline i64 length(i64 dx, i64 dy) { return static_cast<i64>(distance(0, 0, dx, dy)); }

// The bin of the parts by distance that (dx, dy) belongs to.
i64 distance_bin(View<const i64> table, i64 dx, i64 dy);

// The probability that attention outlasts `steps` (below 2**62), from the probabilities for 2**i steps.
i64 persistence_chance(View<const i64> table, i64 steps);

// The product of all factors but light for a user at (dx, dy) from a camera that looks along `heading`.
// `faces` is the heading of the user, `shown` the number of points of the body in view.
i64 steady_chance(View<const i64> table, i64 heading, i64 dx, i64 dy, i64 faces, i64 posture, i64 shown);

// The probability to notice [2**-53], from steady_chance [2**-31], light [2**-31] and the camera's own [2**-53].
constexpr i64 notice_chance(i64 steady, i64 light, i64 chance) {
    return ((chance >> (53 - BITS)) * product(steady, light)) >> (2 * BITS - 53);
}

// The draw [2**-53] that decides whether a user in view is noticed.
//
// It is that of the last look with the probability that attention has lasted since then, else a new one.
// So misses come in runs, and with a constant chance they are a two-state Markov chain; their rate is as
// configured, since each draw by itself is uniform.
i64 attention(View<const i64> table, View<const u64> keys, View<i64> about, i64 now);

// The perceived identity of a noticed user at a distance of that bin; NOBODY for an unknown person. A track
// ends `patience` steps after the last look at which the user was noticed.
i64 identify(View<const i64> table, View<const i64> confusion, View<const u64> keys, View<i64> about, i64 user, i64 now,
             i64 bin, i64 patience);

struct Offset {
    i64 dx, dy;  // lattice units
};

// (dx, dy), `distance` > 0 long, turned by `turn`/8192 of a turn and stretched to the length `target_length`.
Offset turn_and_stretch(i64 dx, i64 dy, i64 turn, i64 distance, i64 target_length);

// The perceived position of a user at (dx, dy) from the camera, relative to the camera.
Offset perceived_offset(View<const i64> table, View<const u64> keys, i64 now, i64 dx, i64 dy);

// The perceived posture of a user with a posture.
i64 perceived_posture(View<const i64> table, i64 posture, i64 draw);

// The pose of a camera, and its angle and range.
struct Sector {
    i64 x, y;          // lattice units
    i64 triangle;      // that holds (x, y)
    i64 heading;       // 1/4096 turn
    i64 half_angle;    // 1/8192 turn
    i64 near_squared;  // lattice units squared
    i64 far_squared;   // lattice units squared
};

struct GhostPlace {
    bool appears;
    i64 x, y;  // lattice units
};

// A false positive uniform over what is in view: points of the sector are drawn until no wall hides one.
GhostPlace ghost_anywhere(const Mesh& walls, const Sector& sector, u64 key);

// A false positive near a spot (x, y, noise), which the caller must find in range and in the wedge.
GhostPlace ghost_at_spot(const Mesh& walls, const Sector& sector, View<const i64> spot, u64 key);

}  // namespace fleet2d
