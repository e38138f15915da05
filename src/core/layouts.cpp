#include "layouts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

namespace fleet2d {

namespace {

constexpr f64 MOUTH_PENALTY = 3.0;
constexpr f64 MIN_SLOT_WIDTH = 35.0;
// A strip is at least this deep where its slots are least deep.
constexpr i64 SHALLOWEST = 20;
// How much of the corridor the last room of the front strip needs for its door, and least lengths of the corridor and
// its closet, and the closet's largest.
constexpr i64 REACH = 25;
constexpr i64 MIN_CORRIDOR = 24;
constexpr i64 MIN_CLOSET = 24, MAX_CLOSET = 52;

struct RoomBox {
    i64 room, x0, y0, x1, y1;
};
using RoomBoxes = std::vector<RoomBox>;

Array<i64, 2> box_rows(const RoomBoxes& boxes) {
    auto rows = Array<i64, 2>::empty({static_cast<i64>(boxes.size()), 5});
    i64 i = 0;
    for (const RoomBox& box : boxes) {
        const std::array<i64, 5> row{box.room, box.x0, box.y0, box.x1, box.y1};
        std::copy(row.begin(), row.end(), rows[i++].begin());
    }
    return rows;
}

// A sum of positive numbers, rounded once (Shewchuk 1997, as Python's fsum).
class ExactSum {
public:
    void add(f64 number) {
        std::size_t kept = 0;
        for (f64 part : parts_) {
            if (std::abs(number) < std::abs(part)) std::swap(number, part);
            const f64 high = number + part;
            const f64 low = part - (high - number);
            if (low != 0) parts_[kept++] = low;
            number = high;
        }
        parts_.resize(kept);
        parts_.push_back(number);
    }

    f64 value() const {
        std::size_t n = parts_.size();
        if (n == 0) return 0.0;
        f64 high = parts_[--n];
        f64 low = 0.0;
        while (n > 0) {
            const f64 sum = high + parts_[--n];
            low = parts_[n] - (sum - high);
            high = sum;
            if (low != 0) break;
        }
        // What is exactly halfway between two floats is rounded by the rest.
        if (n > 0 && ((low < 0 && parts_[n - 1] < 0) || (low > 0 && parts_[n - 1] > 0))) {
            const f64 twice = 2 * low;
            const f64 sum = high + twice;
            if (twice == sum - high) high = sum;
        }
        return high;
    }

private:
    std::vector<f64> parts_;
};

f64 sum_of(const std::vector<f64>& numbers) {
    ExactSum sum;
    for (const f64 number : numbers) sum.add(number);
    return sum.value();
}

// The ends of parts of [low, high] in proportion to sizes.
std::vector<i64> divide_span(const std::vector<f64>& sizes, i64 low, i64 high) {
    const f64 total = sum_of(sizes);
    std::vector<i64> ends{low};
    f64 reached = 0.0;
    for (const f64 size : sizes) {
        reached += size;
        ends.push_back(low + static_cast<i64>(static_cast<f64>(high - low) * reached / total + 0.5));
    }
    return ends;
}

f64 slenderness(const RoomBoxes& boxes) {
    f64 total = 0.0;
    for (const RoomBox& box : boxes) {
        const i64 width = box.x1 - box.x0 - INNER_WALL, height = box.y1 - box.y0 - INNER_WALL;
        const auto w = static_cast<f64>(width), h = static_cast<f64>(height);
        f64 ratio = 0.0;
        if (width > height) {
            ratio = height > 0 ? w / h : 99.0;
        } else {
            ratio = h / static_cast<f64>(std::max<i64>(width, 1));
        }
        if (ratio > 1.2) total += (ratio - 1.2) * (ratio - 1.2);
    }
    return total;
}

// One of the trees while it is cut.
class Cutter {
public:
    Cutter(const Divisions& trees, View<const f64> areas) : nodes_(trees.nodes), ends_(nodes_.size()) {
        sizes_.resize(ends_.size());
        for (i64 start : trees.starts) measure(start, areas);
    }

    void slice(i64 node, RoomBox frame, RoomBoxes& boxes) const {
        const i64 kind = nodes_(node, 0);
        if (kind >= 0) {
            frame.room = kind;
            boxes.push_back(frame);
            return;
        }
        const bool across = kind == -2;
        std::vector<i64> parts;
        std::vector<f64> sizes;
        i64 part = node + 1;
        for (i64 k = 0; k < nodes_(node, 1); ++k) {
            parts.push_back(part);
            sizes.push_back(sizes_[static_cast<std::size_t>(part)]);
            part = ends_[static_cast<std::size_t>(part)];
        }
        const auto ends = divide_span(sizes, across ? frame.x0 : frame.y0, across ? frame.x1 : frame.y1);
        for (std::size_t k = 0; k < parts.size(); ++k) {
            RoomBox inner = frame;
            (across ? inner.x0 : inner.y0) = ends[k];
            (across ? inner.x1 : inner.y1) = ends[k + 1];
            slice(parts[k], inner, boxes);
        }
    }

private:
    // Notes the area of a node and the node after its last part.
    void measure(i64 node, View<const f64> areas) {
        const auto at = static_cast<std::size_t>(node);
        ends_[at] = node + 1;
        if (nodes_(node, 0) >= 0) {
            sizes_[at] = areas[nodes_(node, 0)] * static_cast<f64>(nodes_(node, 1)) / 100;
            return;
        }
        ExactSum sum;
        for (i64 k = 0; k < nodes_(node, 1); ++k) {
            const i64 part = ends_[at];
            measure(part, areas);
            sum.add(sizes_[static_cast<std::size_t>(part)]);
            ends_[at] = ends_[static_cast<std::size_t>(part)];
        }
        sizes_[at] = sum.value();
    }

    View<const i64, 2> nodes_;
    std::vector<i64> ends_;
    std::vector<f64> sizes_;
};

// How many corridors do not end at a single room.
i64 blocked_mouths(const RoomBoxes& boxes, View<const i64, 2> mouths) {
    i64 blocked = 0;
    for (i64 i = 0; i < mouths.size(); ++i) {
        const View<const i64> mouth = mouths[i];
        blocked += std::none_of(boxes.begin(), boxes.end(), [&](const RoomBox& box) {
            return box.x0 <= mouth[0] && mouth[2] <= box.x1 && box.y0 <= mouth[1] && mouth[3] <= box.y1;
        });
    }
    return blocked;
}

// Slots of a strip, with their gross areas.
class Strip {
public:
    Strip(View<const i64, 2> slots, View<const f64> areas) : slots_(slots), areas_(areas) {
        for (i64 i = 0; i < slots.size(); ++i) {
            f64 size = areas[slots(i, 0)];
            all_.add(size);
            if (slots(i, 1) >= 0) {
                size += areas[slots(i, 1)];
                all_.add(areas[slots(i, 1)]);
            }
            sizes_.push_back(size);
            bays_.push_back(slots(i, 2));
        }
    }

    void deepen_at_end(i64 depth) { bays_.back() += depth; }

    std::vector<f64> widths(i64 depth) const {
        std::vector<f64> widths;
        for (std::size_t i = 0; i < sizes_.size(); ++i) {
            widths.push_back(std::max(sizes_[i] / static_cast<f64>(depth + bays_[i]), MIN_SLOT_WIDTH));
        }
        return widths;
    }

    // The depth at which it has a length; 0 for none.
    i64 depth(i64 length) const {
        const auto asked = static_cast<f64>(length);
        i64 low = std::max(SHALLOWEST, SHALLOWEST - *std::min_element(bays_.begin(), bays_.end()));
        i64 high = DEEPEST_STRIP;
        if (std::all_of(bays_.begin(), bays_.end(), [](i64 bay) { return bay == 0; })) {
            const f64 depth = all_.value() / asked;
            const bool is_possible = static_cast<f64>(low) <= depth && depth <= static_cast<f64>(high);
            return is_possible ? static_cast<i64>(depth + 0.5) : 0;
        }
        if (sum_of(widths(low)) < asked) return 0;
        while (high - low > 1) {
            const i64 middle = (low + high) / 2;
            (sum_of(widths(middle)) > asked ? low : high) = middle;
        }
        return high;
    }

    RoomBoxes boxes(i64 length, i64 depth) const {
        RoomBoxes boxes;
        const auto ends = divide_span(widths(depth), 0, length);
        for (i64 i = 0; i < slots_.size(); ++i) {
            const auto k = static_cast<std::size_t>(i);
            const i64 back = depth + bays_[k];
            const i64 first = slots_(i, 0), second = slots_(i, 1);
            if (second < 0) {
                boxes.push_back({first, ends[k], 0, ends[k + 1], back});
                continue;
            }
            const f64 share = static_cast<f64>(back) * areas_[first] / (areas_[first] + areas_[second]);
            const auto middle = static_cast<i64>(share + 0.5);
            boxes.push_back({first, ends[k], 0, ends[k + 1], middle});
            boxes.push_back({second, ends[k], middle, ends[k + 1], back});
        }
        return boxes;
    }

private:
    View<const i64, 2> slots_;
    View<const f64> areas_;
    ExactSum all_;
    std::vector<f64> sizes_;
    std::vector<i64> bays_;
};

// The corridor from y = 0 on, with its closet, and the strip of rooms above it; empty if there is no space for it.
struct Beside {
    RoomBoxes hallway, above;
};

Beside beside(const CorridorRule& corridor, const RoomBoxes& strip, View<const f64> areas) {
    Beside made;
    const i64 length = strip.back().x1;
    i64 end = corridor.suite ? strip.back().x0 : length;
    for (RoomBox box : strip) {
        if (!corridor.suite || box.x0 < end) {
            box.y0 += corridor.width;
            box.y1 += corridor.width;
        }
        made.above.push_back(box);
    }
    if (corridor.closet >= 0) {
        const auto needed = static_cast<i64>(areas[corridor.closet] / static_cast<f64>(corridor.width) + 0.5);
        end -= std::clamp(needed, MIN_CLOSET, MAX_CLOSET);
        made.hallway.push_back({corridor.closet, end, 0, length, corridor.width});
    }
    if (end < MIN_CORRIDOR) return {};
    made.hallway.push_back({corridor.hall, 0, 0, end, corridor.width});
    return made;
}

struct PlacedWing {
    RoomBoxes boxes;
    i64 depth = 0;  // of the strip below
};

PlacedWing place_wing(View<const i64, 2> front, View<const i64, 2> back, View<const f64> areas,
                      const CorridorRule& corridor, i64 back_depth, i64 least, i64 most) {
    Strip behind(back, areas);
    if (corridor.suite) behind.deepen_at_end(corridor.width);
    const auto length = static_cast<i64>(sum_of(behind.widths(back_depth)) + 0.5);
    const Strip before(front, areas);
    const i64 depth = before.depth(length);
    if (depth < least || depth > most) return {};
    RoomBoxes boxes = before.boxes(length, depth);
    const RoomBoxes strip = behind.boxes(length, back_depth);
    if (corridor.suite && boxes.back().x0 > strip.back().x0 - REACH) {
        const CorridorRule shorter{corridor.hall, corridor.width, 0, corridor.closet};
        return place_wing(front, back, areas, shorter, back_depth, least, most);
    }
    for (RoomBox& box : boxes) std::tie(box.y0, box.y1) = std::pair(-box.y1, -box.y0);
    const Beside made = beside(corridor, strip, areas);
    if (made.hallway.empty()) return {};
    boxes.insert(boxes.end(), made.hallway.begin(), made.hallway.end());
    boxes.insert(boxes.end(), made.above.begin(), made.above.end());
    return {boxes, depth};
}

}  // namespace

bool is_promising(View<const i64, 2> boxes, View<const f64, 2> limits) {
    for (i64 i = 0; i < boxes.size(); ++i) {
        const i64 width = boxes(i, 3) - boxes(i, 1) - INNER_WALL, height = boxes(i, 4) - boxes(i, 2) - INNER_WALL;
        const auto shorter = static_cast<f64>(std::min(width, height));
        const auto longer = static_cast<f64>(std::max(width, height));
        const i64 room = boxes(i, 0);
        if (shorter < limits(room, 0) || longer > limits(room, 1) * shorter) return false;
    }
    return true;
}

Array<i64, 2> squarest_rooms(const Divisions& trees, View<const f64> areas, View<const i64> sides,
                             View<const i64, 2> mouths) {
    const Cutter cutter(trees, areas);
    const RoomBox frame{0, sides[0], sides[1], sides[2], sides[3]};
    RoomBoxes best, boxes;
    f64 least = std::numeric_limits<f64>::infinity();
    for (const i64 start : trees.starts) {
        boxes.clear();
        cutter.slice(start, frame, boxes);
        const f64 penalty = slenderness(boxes) + MOUTH_PENALTY * static_cast<f64>(blocked_mouths(boxes, mouths));
        if (penalty < least) {
            least = penalty;
            best = boxes;
        }
    }
    return box_rows(best);
}

Array<i64, 2> strip_rooms(View<const i64, 2> slots, View<const f64> areas, i64 length, i64 least, i64 most) {
    const Strip strip(slots, areas);
    const i64 depth = strip.depth(length);
    return box_rows(least <= depth && depth <= most ? strip.boxes(length, depth) : RoomBoxes{});
}

Array<i64, 2> row_rooms(View<const i64, 2> slots, View<const f64> areas, const CorridorRule& corridor, i64 length,
                        i64 least, i64 most) {
    Strip strip(slots, areas);
    if (corridor.suite) strip.deepen_at_end(corridor.width);
    const i64 depth = strip.depth(length);
    if (depth < least || depth > most) return box_rows({});
    Beside made = beside(corridor, strip.boxes(length, depth), areas);
    made.above.insert(made.above.end(), made.hallway.begin(), made.hallway.end());
    return box_rows(made.above);
}

WingRooms wing_rooms(View<const i64, 2> front, View<const i64, 2> back, View<const f64> areas,
                     const CorridorRule& corridor, i64 back_depth, i64 least, i64 most) {
    auto [boxes, depth] = place_wing(front, back, areas, corridor, back_depth, least, most);
    return {box_rows(boxes), depth};
}

i64 squarest_depth(View<const i64, 2> front, View<const i64, 2> back, View<const f64> areas,
                   const CorridorRule& corridor, View<const i64> depths, i64 least, i64 most,
                   View<const f64, 2> limits) {
    i64 best = -1;
    f64 smallest = std::numeric_limits<f64>::infinity();
    for (i64 i = 0; i < depths.size(); ++i) {
        const RoomBoxes boxes = place_wing(front, back, areas, corridor, depths[i], least, most).boxes;
        if (boxes.empty() || !is_promising(box_rows(boxes), limits)) continue;
        const f64 found = slenderness(boxes);
        if (found < smallest) {
            smallest = found;
            best = i;
        }
    }
    return best;
}

}  // namespace fleet2d
