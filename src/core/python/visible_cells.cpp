#include "visible_cells.hpp"

#include "mesh.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

Array<i32, 2> array_of(const std::vector<Span>& spans) {
    auto result = Array<i32, 2>::empty({static_cast<i64>(spans.size()), 3});
    i32* next = result.data();
    for (const Span& span : spans) {
        *next++ = span.row;
        *next++ = span.first;
        *next++ = span.last;
    }
    return result;
}

void mark_spans(View<const i32, 2> spans, View<bool, 2> mask) {
    require(spans.shape[1] == 3, "spans must be (n, 3), row, first and last column");
    for (i64 i = 0; i < spans.size(); ++i) {
        const i64 row = spans(i, 0), first = spans(i, 1), last = spans(i, 2);
        require(0 <= row && row < mask.shape[0] && 0 <= first && last < mask.shape[1], "spans must lie in the mask");
        for (i64 column = first; column <= last; ++column) mask(row, column) = true;
    }
}

}  // namespace

void bind_visible_cells(nb::module_& m) {
    m.def(
        "cells_in_view",
        [](const Mesh& mesh, i64 x, i64 y, i64 heading, const Reach& reach, i64 rows, i64 columns) {
            check_reach(reach);
            require(0 <= rows && rows <= LIMIT && 0 <= columns && columns <= LIMIT,
                    "rows and columns must be in 0 to 2**20");
            CellFinder finder(mesh, rows, columns);
            return array_of(finder.cells_in_view({x, y, heading & (TURN - 1)}, reach));
        },
        "mesh"_a, "x"_a, "y"_a, "heading"_a, "reach"_a, "rows"_a, "columns"_a, Unlocked(),
        R"(Find the cells whose centre is in view: in range, within the angle, and in line of sight.

Args:
    mesh: Free space.
    x: Position of the camera [lattice units].
    y: Position of the camera [lattice units].
    heading: Its heading [1/4096 turn].
    reach: Its range and angle, a `Reach`.
    rows: Height of the grid of cells.
    columns: Width of the grid.

Returns:
    int32 (n, 3), row, first and last column of cells in view: none twice, in no particular order;
    empty for a camera outside or on a wall.)");
    m.def("mark_spans", &mark_spans, "spans"_a, "mask"_a, Unlocked(),
          R"(Set the cells of spans in a mask.

Args:
    spans: int32 (n, 3), row, first and last column of each.
    mask: Out: bool (rows, columns).)");
}

}  // namespace fleet2d
