// Numbers of several people side by side, on which one instruction works at once.
//
// What is computed of each is the same as if it were alone: no operation mixes them.
#pragma once

#include "array.hpp"

namespace fleet2d {

template <int W>
struct Lanes;

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__)
// A warning that vectors are passed in another way on other processors: here all functions that do are inlined. Clang
// inlines only what such a function calls itself, so that it would be slower than one person after the other.
#pragma GCC diagnostic ignored "-Wpsabi"
// A function for processors that work on four numbers at once; all that it calls must be inlined.
#define FLEET2D_FOUR __attribute__((target("avx2"), flatten))
// The most people side by side.
inline int widest() { return __builtin_cpu_supports("avx2") ? 4 : 1; }

template <int W>
struct Lanes {
    typedef f64 All __attribute__((vector_size(W * sizeof(f64))));
    All all;

    Lanes() = default;
    Lanes(f64 value) : all(value - All{}) {}
    f64& operator[](i64 lane) { return reinterpret_cast<f64*>(&all)[lane]; }
    f64 operator[](i64 lane) const { return reinterpret_cast<const f64*>(&all)[lane]; }

    void operator+=(const Lanes& other) { all += other.all; }
    void operator-=(const Lanes& other) { all -= other.all; }
    void operator*=(const Lanes& other) { all *= other.all; }
    void operator/=(const Lanes& other) { all /= other.all; }
};
#else
#define FLEET2D_FOUR
inline int widest() { return 1; }

template <int W>
struct Lanes {
    f64 all[W];

    Lanes() = default;
    Lanes(f64 value) { std::fill_n(all, W, value); }
    f64& operator[](i64 lane) { return all[lane]; }
    f64 operator[](i64 lane) const { return all[lane]; }

    void operator+=(const Lanes& other) {
        for (int i = 0; i < W; ++i) all[i] += other.all[i];
    }
    void operator-=(const Lanes& other) {
        for (int i = 0; i < W; ++i) all[i] -= other.all[i];
    }
    void operator*=(const Lanes& other) {
        for (int i = 0; i < W; ++i) all[i] *= other.all[i];
    }
    void operator/=(const Lanes& other) {
        for (int i = 0; i < W; ++i) all[i] /= other.all[i];
    }
};
#endif

template <>
struct Lanes<1> {
    f64 alone;

    Lanes() = default;
    Lanes(f64 value) : alone(value) {}
    f64& operator[](i64) { return alone; }
    f64 operator[](i64) const { return alone; }

    void operator+=(const Lanes& other) { alone += other.alone; }
    void operator-=(const Lanes& other) { alone -= other.alone; }
    void operator*=(const Lanes& other) { alone *= other.alone; }
    void operator/=(const Lanes& other) { alone /= other.alone; }
};

template <int W>
Lanes<W> operator+(Lanes<W> a, const Lanes<W>& b) {
    a += b;
    return a;
}

template <int W>
Lanes<W> operator-(Lanes<W> a, const Lanes<W>& b) {
    a -= b;
    return a;
}

template <int W>
Lanes<W> operator*(Lanes<W> a, const Lanes<W>& b) {
    a *= b;
    return a;
}

template <int W>
Lanes<W> operator/(Lanes<W> a, const Lanes<W>& b) {
    a /= b;
    return a;
}

}  // namespace fleet2d
