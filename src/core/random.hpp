// Counter-based random bits: a pure function of (key, counter), so no draw depends on another.
//
// The generator is SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators",
// OOPSLA 2014), addressed by counter instead of by state. Keys come from fleet2d.runtime.determinism.
#pragma once

#include "array.hpp"

namespace fleet2d {

// The sum of eight uniform bytes: mean 1020, variance 8 * (256**2 - 1) / 12 = 43690.
inline constexpr i64 BELL_MEAN = 1020;
inline constexpr f64 BELL_STD = 209.0215299915;

// 64 random bits for one counter of the stream `key`.
constexpr u64 random_bits(u64 key, u64 counter) {
    u64 z = key + (counter + 1) * 0x9E3779B97F4A7C15;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB;
    return z ^ (z >> 31);
}

// An integer in [0, bound), 0 < bound < 2**31, by multiply and shift.
constexpr i64 random_below(u64 key, u64 counter, u64 bound) {
    return static_cast<i64>(((random_bits(key, counter) >> 32) * bound) >> 32);
}

// A number in [0, 1), a multiple of 2**-53.
constexpr f64 random_uniform(u64 key, u64 counter) {
    return static_cast<f64>(random_bits(key, counter) >> 11) * 0x1p-53;
}

// A bell-shaped integer in [-1020, 1020], mean 0, standard deviation BELL_STD.
//
// The sum of eight uniform bytes: close to normal (excess kurtosis -0.15), cut at 4.88 standard
// deviations, and exact on every machine, which a logarithm or a cosine is not.
constexpr i64 random_bell(u64 key, u64 counter) {
    constexpr u64 odd_bytes = 0x00FF00FF00FF00FF;
    constexpr u64 four_lanes = 0x0001000100010001;
    const u64 word = random_bits(key, counter);
    const u64 lanes = (word & odd_bytes) + ((word >> 8) & odd_bytes);
    return static_cast<i64>((lanes * four_lanes) >> 48) - BELL_MEAN;
}

// A sequence of draws of one stream at one step.
struct StepDraws {
    u64 key;
    u64 count = 0;

    StepDraws(u64 stream, u64 step) : key(random_bits(stream, step)) {}

    i64 below(u64 bound) { return random_below(key, count++, bound); }
    f64 uniform() { return random_uniform(key, count++); }
};

// Small draws, several from each draw of a stream.
struct Bits {
    static constexpr u64 MOST = 30;
    u64 bits = 0;
    u64 left = 0;

    // An integer in [0, 2**count), count <= MOST.
    i64 take(StepDraws& draws, u64 count) {
        if (left < count) {
            bits = static_cast<u64>(draws.below(u64{1} << MOST));
            left = MOST;
        }
        const auto value = static_cast<i64>(bits & ((u64{1} << count) - 1));
        bits >>= count;
        left -= count;
        return value;
    }
};

}  // namespace fleet2d
