#include "../layouts.hpp"

#include <cmath>

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

template <>
inline constexpr std::size_t border::members_of<Divisions> = 2;

template <>
inline constexpr std::size_t border::members_of<CorridorRule> = 4;

namespace {

constexpr i64 LONGEST = i64{1} << 20;  // units
constexpr i64 MOST_DEPTH = 64;         // of a tree

bool is_length(i64 units) { return -LONGEST <= units && units <= LONGEST; }

void check_areas(View<const f64> areas) {
    for (const f64 area : areas) {
        require(std::isfinite(area) && 0 <= area && area <= 1e12, "areas must be in 0 to 1e12");
    }
}

// Rooms with an area that is divided by.
void check_rooms(View<const i64, 2> slots, View<const f64> areas) {
    require(slots.shape[1] == 3 && slots.size() > 0, "slots must be (n, 3), and at least one");
    for (i64 i = 0; i < slots.size(); ++i) {
        const i64 first = slots(i, 0), second = slots(i, 1);
        require(0 <= first && first < areas.size() && -1 <= second && second < areas.size(),
                "rooms of slots must be indices of areas, the second -1 for none");
        require(areas[first] > 0 && (second < 0 || areas[second] > 0), "areas of rooms must be above 0");
        require(is_length(slots(i, 2)), "bays must be at most 2**20");
    }
}

void check_corridor(const CorridorRule& corridor, View<const f64> areas) {
    require(0 < corridor.width && is_length(corridor.width), "a corridor's width must be in 1 to 2**20");
    require(-1 <= corridor.closet && corridor.closet < areas.size(), "closet must be a room, or -1");
}

void check_depths(i64 least, i64 most) {
    require(0 < least && least <= most && is_length(most), "least and most must be in 1 to 2**20");
}

void check_wing(View<const i64, 2> front, View<const i64, 2> back, View<const f64> areas,
                const CorridorRule& corridor) {
    check_areas(areas);
    check_rooms(front, areas);
    check_rooms(back, areas);
    check_corridor(corridor, areas);
}

void check_back(View<const i64, 2> back, i64 depth) {
    require(0 < depth && is_length(depth), "a depth must be in 1 to 2**20");
    for (i64 i = 0; i < back.size(); ++i) require(depth + back(i, 2) > 0, "slots must be deeper than 0");
}

// The node after a tree, each of whose nodes is a cut or a room.
i64 check_tree(const Divisions& trees, View<const f64> areas, i64 node, i64 depth) {
    require(0 <= node && node < trees.nodes.size(), "a tree must end within nodes");
    require(depth < MOST_DEPTH, "trees must be less than 64 nodes deep");
    const i64 kind = trees.nodes(node, 0), number = trees.nodes(node, 1);
    if (kind >= 0) {
        require(kind < areas.size(), "rooms of trees must be indices of areas");
        require(areas[kind] > 0 && 0 < number && number <= 100, "a room of a tree must have an area, and 1 to 100 %");
        return node + 1;
    }
    require(kind >= -2 && number > 0, "a cut must be -1 or -2, and have a part");
    i64 part = node + 1;
    for (i64 k = 0; k < number; ++k) part = check_tree(trees, areas, part, depth + 1);
    return part;
}

}  // namespace

void bind_layouts(nb::module_& m) {
    m.attr("INNER_WALL") = INNER_WALL;
    m.attr("DEEPEST_STRIP") = DEEPEST_STRIP;
    m.def(
        "squarest_rooms",
        [](const Divisions& trees, View<const f64> areas, View<const i64> sides, View<const i64, 2> mouths) {
            check_areas(areas);
            require(trees.nodes.shape[1] == 2, "nodes must be (n, 2)");
            for (const i64 start : trees.starts) check_tree(trees, areas, start, 0);
            require(sides.size() == 4 && all_in_range(sides, -LONGEST, LONGEST + 1),
                    "sides must be four lengths of at most 2**20");
            require(mouths.shape[1] == 4, "mouths must be (n, 4)");
            return squarest_rooms(trees, areas, sides, mouths);
        },
        "trees"_a, "areas"_a, "sides"_a, "mouths"_a, Unlocked(),
        R"(Return the rooms of the tree that makes them squarest in a rectangle, the first if tied.

Args:
    trees: The trees, `Divisions`.
    areas: Gross area of each room, float64 (rooms,) [units²].
    sides: The rectangle x0, y0, x1, y1, int64 (4,) [units].
    mouths: Ends of corridors at a side of it, at which no wall should end, int64 (n, 4).

Returns:
    Room and sides of each box, int64 (n, 5).)");
    m.def(
        "is_promising",
        [](View<const i64, 2> boxes, View<const f64, 2> limits) {
            require(boxes.shape[1] == 5 && limits.shape[1] == 2, "boxes must be (n, 5), limits (rooms, 2)");
            require(all_in_range(boxes, -LONGEST, LONGEST + 1), "boxes must be within 2**20");
            for (i64 i = 0; i < boxes.size(); ++i) {
                require(0 <= boxes(i, 0) && boxes(i, 0) < limits.size(), "rooms must be indices of limits");
            }
            return is_promising(boxes, limits);
        },
        "boxes"_a, "limits"_a, Unlocked(),
        R"(Return whether rooms could fit at another scale: none is far too narrow or too long.

Args:
    boxes: Room and sides of each box, int64 (n, 5) [units].
    limits: Least shorter side [units] and largest ratio of the sides of each room, float64
        (rooms, 2).)");
    m.def(
        "strip_rooms",
        [](View<const i64, 2> slots, View<const f64> areas, i64 length, i64 least, i64 most) {
            check_areas(areas);
            check_rooms(slots, areas);
            check_depths(least, most);
            require(0 < length && is_length(length), "length must be in 1 to 2**20");
            return strip_rooms(slots, areas, length, least, most);
        },
        "slots"_a, "areas"_a, "length"_a, "least"_a, "most"_a, Unlocked(),
        R"(Return rooms side by side along x, from 0 on, with their front at y = 0.

Args:
    slots: A room, the one behind it or -1, and how much deeper than the others they are, int64 (n, 3).
    areas: Gross area of each room, float64 (rooms,) [units²].
    length: Their length [units].
    least: Least depth [units].
    most: Largest depth [units].

Returns:
    Room and sides of each box, int64 (n, 5); none if no such depth has that length.)");
    m.def(
        "row_rooms",
        [](View<const i64, 2> slots, View<const f64> areas, const CorridorRule& corridor, i64 length, i64 least,
           i64 most) {
            check_areas(areas);
            check_rooms(slots, areas);
            check_depths(least, most);
            check_corridor(corridor, areas);
            require(0 < length && is_length(length), "length must be in 1 to 2**20");
            return row_rooms(slots, areas, corridor, length, least, most);
        },
        "slots"_a, "areas"_a, "corridor"_a, "length"_a, "least"_a, "most"_a, Unlocked(),
        R"(Return the rooms of a strip above a corridor that begins at y = 0; see `strip_rooms`.

Args:
    slots: As of `strip_rooms`.
    areas: Gross area of each room, float64 (rooms,) [units²].
    corridor: The corridor, a `CorridorRule`.
    length: The length of both [units].
    least: Least depth of the strip [units].
    most: Its largest depth [units].

Returns:
    Room and sides of each box, int64 (n, 5), those of the corridor last; none if they don't fit.)");
    m.def(
        "wing_rooms",
        [](View<const i64, 2> front, View<const i64, 2> back, View<const f64> areas, const CorridorRule& corridor,
           i64 back_depth, i64 least, i64 most) {
            check_depths(least, most);
            check_wing(front, back, areas, corridor);
            check_back(back, back_depth);
            auto [boxes, depth] = wing_rooms(front, back, areas, corridor, back_depth, least, most);
            return std::tuple(std::move(boxes), depth);
        },
        "front"_a, "back"_a, "areas"_a, "corridor"_a, "back_depth"_a, "least"_a, "most"_a, Unlocked(),
        R"(Return the rooms of a wing: a strip below a corridor that begins at y = 0, and one above.

Args:
    front: The slots of the strip below it, as of `strip_rooms`.
    back: Those of the strip above it.
    areas: Gross area of each room, float64 (rooms,) [units²].
    corridor: The corridor, a `CorridorRule`.
    back_depth: Depth of the strip above it [units].
    least: Least depth of the strip below it [units].
    most: Its largest depth [units].

Returns:
    Room and sides of each box, int64 (n, 5), and the depth of the strip below; none if they don't
    fit together.)");
    m.def(
        "squarest_depth",
        [](View<const i64, 2> front, View<const i64, 2> back, View<const f64> areas, const CorridorRule& corridor,
           View<const i64> depths, i64 least, i64 most, View<const f64, 2> limits) {
            check_depths(least, most);
            check_wing(front, back, areas, corridor);
            for (const i64 depth : depths) check_back(back, depth);
            require(limits.shape[1] == 2 && limits.size() >= areas.size() && 0 <= corridor.hall &&
                        corridor.hall < limits.size(),
                    "limits must be (rooms, 2), also for the hallway");
            return squarest_depth(front, back, areas, corridor, depths, least, most, limits);
        },
        "front"_a, "back"_a, "areas"_a, "corridor"_a, "depths"_a, "least"_a, "most"_a, "limits"_a, Unlocked(),
        R"(Return which depth of the strip above makes the rooms of a wing squarest, the first if tied.

Args:
    front: As of `wing_rooms`.
    back: As of `wing_rooms`.
    areas: As of `wing_rooms`.
    corridor: As of `wing_rooms`.
    depths: The depths to try, int64 (n,) [units].
    least: As of `wing_rooms`.
    most: As of `wing_rooms`.
    limits: As of `is_promising`.

Returns:
    The index of the depth; -1 if none makes promising rooms.)");
}

}  // namespace fleet2d
