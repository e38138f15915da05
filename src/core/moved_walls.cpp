#include "moved_walls.hpp"

#include <cstdlib>
#include <utility>
#include <vector>

namespace fleet2d {
namespace {

struct UprightWall {
    i64 x, y;    // where it begins
    i64 dx, dy;  // its way: -1, 0 or 1
    i64 length = 0;
    i64 turn = 0;                  // of the outline where it begins: 1 left, -1 right
    i64 at_start = 0, at_end = 0;  // by how much it gets longer there
    bool is_hidden = false, begins_apart = false;
};

i64 sign(i64 number) { return (number > 0) - (number < 0); }

// The walls of a ring, without corners in straight walls; none if a wall is slanted, or turns back.
std::vector<UprightWall> walls_of(View<const i64, 2> ring) {
    std::vector<UprightWall> walls;
    const i64 corners = ring.size();
    const auto way = [&](i64 i) {
        const i64 next = (i + 1) % corners;
        return std::pair(sign(ring(next, 0) - ring(i, 0)), sign(ring(next, 1) - ring(i, 1)));
    };
    for (i64 i = 0; i < corners; ++i) {
        const auto [dx, dy] = way(i);
        if ((dx == 0) == (dy == 0)) return {};
        const auto [before_x, before_y] = way((i + corners - 1) % corners);
        if (dx == before_x && dy == before_y) continue;
        const i64 turn = before_x * dy - before_y * dx;
        if (turn == 0) return {};
        walls.push_back({.x = ring(i, 0), .y = ring(i, 1), .dx = dx, .dy = dy, .turn = turn});
    }
    return walls;
}

}  // namespace

Array<i64, 2> move_walls(View<const i64, 2> ring, i64 reach, i64 half) {
    auto none = Array<i64, 2>::empty({0, 2});
    std::vector<UprightWall> walls = walls_of(ring);
    const std::size_t count = walls.size();
    const auto after = [&](std::size_t i) -> UprightWall& { return walls[i + 1 < count ? i + 1 : 0]; };
    const auto before = [&](std::size_t i) -> UprightWall& { return walls[i > 0 ? i - 1 : count - 1]; };
    const auto further = [&](i64 turn) { return turn > 0 ? -reach : half; };
    for (std::size_t i = 0; i < count; ++i) {
        UprightWall& wall = walls[i];
        const UprightWall& next = after(i);
        wall.length = std::abs(next.x - wall.x) + std::abs(next.y - wall.y);
        wall.at_start = further(wall.turn);
        wall.at_end = further(next.turn);
        wall.is_hidden = wall.length + wall.at_start + wall.at_end <= 0;
        if (wall.is_hidden && wall.turn == next.turn) return none;
    }
    // A step that is lower than the slanted side of the octagon is hidden behind that.
    for (std::size_t i = 0; i < count; ++i) {
        const UprightWall& step = walls[i];
        if (!step.is_hidden) continue;
        if (before(i).is_hidden) return none;
        if (step.turn > 0) {
            before(i).at_end = -half - step.length;
        } else {
            after(i).at_start = -half - step.length;
            after(i).begins_apart = true;
        }
    }
    auto moved = Array<i64, 2>::empty({2 * static_cast<i64>(count), 2});
    i64 corners = 0;
    const auto add = [&](const UprightWall& wall, i64 along) {
        moved(corners, 0) = wall.x - reach * wall.dy + along * wall.dx;
        moved(corners++, 1) = wall.y + reach * wall.dx + along * wall.dy;
    };
    for (const UprightWall& wall : walls) {
        if (wall.is_hidden) continue;
        if (wall.length + wall.at_start + wall.at_end <= 0) return none;
        // Where the outline turns left, a wall begins where the one before it ends.
        if (wall.turn < 0 || wall.begins_apart) add(wall, -wall.at_start);
        add(wall, wall.length + wall.at_end);
    }
    moved.truncate(corners);
    return moved;
}

}  // namespace fleet2d
