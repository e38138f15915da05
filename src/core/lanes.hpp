// Numbers of several people side by side, on which one instruction works at once.
//
// What is computed of each is the same as if it were alone: no operation mixes them.
#pragma once

#include "array.hpp"

namespace fleet2d {

template <int W>
struct Lanes;

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__)
// The most people side by side. Clang inlines only what a function with `flatten` calls itself, so that four people
// would be slower than one after the other.
inline int widest() {
    if (__builtin_cpu_supports("avx512f")) return 8;
    return __builtin_cpu_supports("avx2") ? 4 : 1;
}

// Do work on W people with the instructions for as many; all that it calls is inlined for that.
template <class Work>
__attribute__((target("avx2"), flatten)) void alone_with_avx2(Work work) {
    work();
}
template <int W, class Work>
    requires(W == 1)
void side_by_side(Work work) {
    // Of one person, several patches are computed at once.
    widest() > 1 ? alone_with_avx2(work) : work();
}
template <int W, class Work>
    requires(W == 4)
__attribute__((target("avx2"), flatten)) void side_by_side(Work work) {
    work();
}
template <int W, class Work>
    requires(W == 8)
__attribute__((target("avx512f"), flatten)) void side_by_side(Work work) {
    work();
}

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
inline int widest() { return 1; }

template <int W, class Work>
void side_by_side(Work work) {
    work();
}

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
