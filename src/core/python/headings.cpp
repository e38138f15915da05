#include "../headings.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_headings(nb::module_& m) {
    m.attr("TURN") = TURN;
    m.attr("HALF_TURN") = HALF_TURN;
    m.attr("QUARTER") = QUARTER;
    m.attr("UNIT") = UNIT;
    // UNIT * sine of i / 8192 of a turn, for a quarter turn: int64 (2049,).
    m.attr("SINES") = border::borrowed(View<const i64>(SINES.data(), {2 * QUARTER + 1}), nb::none()).array;

    m.def("half_sine", &half_sine, "half"_a, "Return UNIT * sine of `half` / 8192 of a turn.");
    m.def("sine", &sine, "heading"_a, "Return UNIT * sine of a heading (any integer).");
    m.def("cosine", &cosine, "heading"_a, "Return UNIT * cosine of a heading (any integer).");
    m.def(
        "heading_of",
        [](i64 dx, i64 dy) {
            constexpr i64 most = i64{1} << 31;  // a product with UNIT, and a sum of two, fit in 64 bits
            require(-most <= dx && dx <= most && -most <= dy && dy <= most, "dx and dy must be within 2**31");
            return heading_of(dx, dy);
        },
        "dx"_a, "dy"_a, "Return the heading nearest to the vector (dx, dy) [lattice units]; 0 for a null vector.");
    m.def("turn_between", &turn_between, "start"_a, "end"_a,
          "Return the shorter signed turn from `start` to `end`, in [-2048, 2047].");
}

}  // namespace fleet2d
