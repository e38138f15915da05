#include "../random.hpp"

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_random(nb::module_& m) {
    m.attr("BELL_MEAN") = BELL_MEAN;
    m.attr("BELL_STD") = BELL_STD;

    m.def("random_bits", &random_bits,
          nb::sig("def random_bits(key: int | numpy.uint64, counter: int | numpy.integer[typing.Any]) -> int"), "key"_a,
          "counter"_a, "Return 64 random bits for `counter` (0 to 2**64 - 1) of the stream `key`.");
    m.def(
        "random_below",
        [](u64 key, u64 counter, u64 bound) {
            require(0 < bound && bound < (u64{1} << 31), "bound must be in 1 to 2**31 - 1");
            return random_below(key, counter, bound);
        },
        nb::sig(
            "def random_below(key: int | numpy.uint64, counter: int | numpy.integer[typing.Any], bound: int) -> int"),
        "key"_a, "counter"_a, "bound"_a, "Return an integer in [0, bound), 0 < bound < 2**31, by multiply and shift.");
    m.def("random_uniform", &random_uniform,
          nb::sig("def random_uniform(key: int | numpy.uint64, counter: int | numpy.integer[typing.Any]) -> float"),
          "key"_a, "counter"_a, "Return a float in [0, 1), a multiple of 2**-53.");
    m.def("random_bell", &random_bell,
          nb::sig("def random_bell(key: int | numpy.uint64, counter: int | numpy.integer[typing.Any]) -> int"), "key"_a,
          "counter"_a,
          R"(Return a bell-shaped integer in [-1020, 1020], mean 0, standard deviation BELL_STD.

The sum of eight uniform bytes: close to normal (excess kurtosis -0.15), cut at 4.88 standard
deviations, and exact on every machine, which a logarithm or a cosine is not.)");
}

}  // namespace fleet2d
