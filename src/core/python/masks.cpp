#include "../masks.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_masks(nb::module_& m) {
    m.def("label_parts", &label_parts, "mask"_a, "diagonal"_a, Unlocked(),
          R"(Number the connected parts of a mask in the order of their first pixels, row by row.

Args:
    mask: bool (rows, columns).
    diagonal: Whether pixels that share only a corner are connected.

Returns:
    Each pixel's part, int32 (rows, columns); -1 outside the mask.)");
    m.def(
        "count_steps",
        [](View<const bool, 2> start, View<const bool, 2> mask) {
            require(start.shape == mask.shape, "start and mask must have one shape");
            return count_steps(start, mask);
        },
        "start"_a, "mask"_a, Unlocked(),
        R"(Count the steps from pixel to pixel across sides, inside a mask, from the nearest start.

Args:
    start: Where to start, bool (rows, columns); pixels outside the mask don't count.
    mask: Where steps may lead, bool (rows, columns).

Returns:
    Steps, int32 (rows, columns); 0 at the start, -1 for unreachable pixels.)");
    m.def(
        "trace_rings",
        [](View<const bool, 2> mask) {
            Rings rings = trace_rings(mask);
            return std::tuple(std::move(rings.corners), std::move(rings.start));
        },
        "mask"_a, Unlocked(),
        R"(Return the border rings of a mask, along the sides of the pixels.

Rings have the mask on their left: outer ones run counter-clockwise, holes clockwise (x is the
column, y is the row). Where two pixels of the mask share only a corner, a ring turns right, so
each ring round one part (connected across sides) passes a point at most once.

Args:
    mask: bool (rows, columns).

Returns:
    The corners of all rings, int32 (n, 2) as (x, y), 0 to columns and 0 to rows; and where each
    ring starts among them, int64 (rings + 1,).)");
}

}  // namespace fleet2d
