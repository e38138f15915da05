#include "perception.hpp"

#include <algorithm>
#include <cmath>

#include "line_of_sight.hpp"

namespace fleet2d {
namespace {

constexpr i64 TRIES = 1024;  // points of a sector that are tried before nothing is taken to be in view

// whole * part / 2**20, rounded down, for any whole below 2**62 and part below 2**20.
constexpr i64 scaled(i64 whole, i64 part) { return (whole >> 20) * part + (((whole & ((1 << 20) - 1)) * part) >> 20); }

}  // namespace

i64 distance_bin(View<const i64> table, i64 dx, i64 dy) { return std::min(length(dx, dy) >> table[SHIFT], BINS - 1); }

i64 persistence_chance(View<const i64> table, i64 steps) {
    i64 share = ONE;
    for (i64 i = AT_STAY; steps > 0; steps >>= 1, ++i) {
        if (steps & 1) share = product(share, table[i]);
    }
    return share;
}

i64 steady_chance(View<const i64> table, i64 heading, i64 dx, i64 dy, i64 faces, i64 posture, i64 shown) {
    i64 bearing = 0, turned = 0;
    if (dx != 0 || dy != 0) {
        const i64 towards = heading_of(dx, dy);
        bearing = turn_between(heading, towards);
        turned = std::abs(turn_between(towards + HALF_TURN, faces));
    }
    i64 share = table[AT_DISTANCE + distance_bin(table, dx, dy)];
    share = product(share, table[AT_BEARING + HALF_TURN + bearing]);
    share = product(share, table[AT_FACING + turned]);
    share = product(share, table[AT_POSTURE + posture]);
    return product(share, table[AT_SHOWN + shown]);
}

i64 attention(View<const i64> table, View<const u64> keys, View<i64> about, i64 now) {
    const i64 before = at(about, About::DRAW_STEP);
    at(about, About::DRAW_STEP) = now;
    const bool lasts = before >= 0 && table[AT_STAY] != 0 &&
                       random_share(stream(keys, UserDraw::ATTEND), now) < persistence_chance(table, now - before);
    if (!lasts) at(about, About::DRAW) = random_chance(stream(keys, UserDraw::DETECT), now);
    return at(about, About::DRAW);
}

i64 identify(View<const i64> table, View<const i64> confusion, View<const u64> keys, View<i64> about, i64 user, i64 now,
             i64 bin, i64 patience) {
    const i64 before = at(about, About::TRACK_STEP);
    at(about, About::TRACK_STEP) = now;
    if (table[KEEPS] == 1 && before >= 0 && now - before < patience) return at(about, About::LAST_IDENTITY);
    const i64 draw = random_share(stream(keys, UserDraw::IDENTIFY), now);
    const i64 right = table[AT_RIGHT + bin];
    i64 identity = NOBODY;
    if (draw < right) {
        identity = user;
    } else if (draw < right + table[AT_MISTAKEN + bin]) {
        const i64 other = pick(confusion, random_share(stream(keys, UserDraw::MISTAKE), now));
        if (other < confusion.size()) identity = other;
    }
    at(about, About::LAST_IDENTITY) = identity;
    return identity;
}

Offset turn_and_stretch(i64 dx, i64 dy, i64 turn, i64 distance, i64 target_length) {
    const i64 cosine = half_sine(turn + 2 * QUARTER), sine = half_sine(turn);
    const i64 turned_x = (dx * cosine - dy * sine) >> 20;  // 2**-10 lattice units
    const i64 turned_y = (dx * sine + dy * cosine) >> 20;
    const i64 whole = distance << 10;
    return {floor_div(2 * turned_x * target_length + whole, 2 * whole),
            floor_div(2 * turned_y * target_length + whole, 2 * whole)};
}

Offset perceived_offset(View<const i64> table, View<const u64> keys, i64 now, i64 dx, i64 dy) {
    const i64 distance = length(dx, dy), turning = table[BEARING_NOISE];
    const i64 noise = table[RANGE_NOISE] + ((table[RANGE_SHARE] * distance) >> 16);
    if (distance == 0 || (noise == 0 && turning == 0)) return {dx, dy};
    const i64 target_length = std::max(i64{0}, distance + random_noise(stream(keys, UserDraw::RANGE), now, noise));
    const i64 turn = random_noise(stream(keys, UserDraw::BEARING), now, turning);
    return turn_and_stretch(dx, dy, turn, distance, target_length);
}

i64 perceived_posture(View<const i64> table, i64 posture, i64 draw) {
    // What is above all but the last sum is the last posture, whatever the last sum is.
    const i64 first = AT_SEEMS + POSTURES * posture;
    return pick(table.slice(first, first + POSTURES - 1), draw);
}

GhostPlace ghost_anywhere(const Mesh& walls, const Sector& sector, u64 key) {
    const i64 half = std::min(sector.half_angle, TURN);
    for (u64 attempt = 0; attempt < TRIES; ++attempt) {
        const i64 part = random_below(key, 2 * attempt, 1 << 20);
        const i64 squared = sector.near_squared + scaled(sector.far_squared - sector.near_squared, part);
        const i64 reach = static_cast<i64>(std::sqrt(static_cast<f64>(squared)));
        const i64 turn = random_below(key, 2 * attempt + 1, static_cast<u64>(2 * half));
        const i64 towards = 2 * sector.heading + turn - half;
        const i64 x = sector.x + ((reach * half_sine(towards + 2 * QUARTER) + UNIT / 2) >> 30);
        const i64 y = sector.y + ((reach * half_sine(towards) + UNIT / 2) >> 30);
        if (line_of_sight(walls, sector.x, sector.y, sector.triangle, x, y)) return {true, x, y};
    }
    return {false, sector.x, sector.y};
}

GhostPlace ghost_at_spot(const Mesh& walls, const Sector& sector, View<const i64> spot, u64 key) {
    const i64 x = spot[0] + random_noise(key, 0, spot[2]);
    const i64 y = spot[1] + random_noise(key, 1, spot[2]);
    return {line_of_sight(walls, sector.x, sector.y, sector.triangle, x, y), x, y};
}

}  // namespace fleet2d
