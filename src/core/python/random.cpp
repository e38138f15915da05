#include "random.hpp"

#include "subjects.hpp"

namespace fleet2d {
namespace {

constexpr u64 LAST_BOUND = (u64{1} << 31) - 1;

void bind_draws(nb::module_& m) {
    nb::class_<StepDraws>(m, "StepDraws", R"(The draws of one stream at one step, one after the other.

Args:
    key: Of the stream.
    step: 0 to 2**64 - 1.)")
        .def(nb::init<u64, u64>(),
             nb::sig("def __init__(self, key: int | numpy.uint64, step: int | numpy.integer[typing.Any]) -> None"),
             "key"_a, "step"_a)
        .def(
            "below",
            [](StepDraws& draws, i64 bound) {
                if (bound <= 0 || static_cast<u64>(bound) > LAST_BOUND) {
                    throw std::invalid_argument("bound is " + std::to_string(bound) +
                                                ": it must be from 1 to 2**31 - 1");
                }
                return draws.below(static_cast<u64>(bound));
            },
            nb::sig("def below(self, bound: int | numpy.integer[typing.Any]) -> int"), "bound"_a,
            "Return an integer from 0 to bound - 1; `bound` is below 2**31.")
        .def("uniform", &StepDraws::uniform, "Return a float64 in [0, 1).")
        .def(
            "__getstate__", [](const StepDraws& draws) { return std::pair(draws.key, draws.count); },
            nb::sig("def __getstate__(self) -> tuple[int, int]"))
        .def(
            "__setstate__",
            [](StepDraws& draws, std::pair<u64, u64> state) {
                new (&draws) StepDraws(0, 0);
                std::tie(draws.key, draws.count) = state;
            },
            nb::sig("def __setstate__(self, state: tuple[int, int], /) -> None"), "state"_a);
    nb::class_<OwnedBits>(m, "Bits", "Small draws, several from each draw of a stream.")
        .def(
            "__init__",
            [](OwnedBits* bits, nb::handle_t<StepDraws> draws) {
                new (bits) OwnedBits{nb::borrow(draws), nb::cast<StepDraws&>(draws), {}};
            },
            "draws"_a)
        .def(
            "take",
            [](OwnedBits& bits, u64 count) {
                require(count <= Bits::MOST, "count must be 0 to 30");
                return bits.bits.take(bits.draws, count);
            },
            "count"_a, "Return a number from 0 to 2**count - 1, all equally likely; `count` is 30 at most.");
}

}  // namespace

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
    m.def(
        "random_bells",
        [](u64 key, View<const i64> counters) {
            auto bells = Array<i64>::empty({counters.size()});
            for (i64 i = 0; i < counters.size(); ++i) bells[i] = random_bell(key, static_cast<u64>(counters[i]));
            return bells;
        },
        "key"_a, "counters"_a, Unlocked(), "Return the bell-shaped integer of each counter, int64 (n,).");
    bind_draws(m);
}

}  // namespace fleet2d
