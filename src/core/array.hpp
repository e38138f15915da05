// Arrays: a view of memory that it doesn't own, and an array that owns its memory.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <type_traits>
#include <utility>

namespace fleet2d {

using u8 = std::uint8_t;
using i8 = std::int8_t;
using i16 = std::int16_t;
using u16 = std::uint16_t;
using i32 = std::int32_t;
using u32 = std::uint32_t;
using i64 = std::int64_t;
using u64 = std::uint64_t;
using f64 = double;

// A view of N dimensions. The last one is contiguous; the others may have any stride.
// Debug builds (FLEET2D_CHECKS) check every index and slice.
template <class T, std::size_t N = 1>
struct View {
    T* data = nullptr;
    std::array<i64, N> shape{};
    std::array<i64, N> stride{};  // elements, not bytes; the last is 1

    constexpr View() = default;
    constexpr View(T* data_, std::array<i64, N> shape_) : data(data_), shape(shape_) {
        i64 step = 1;
        for (std::size_t k = N; k-- > 0;) {
            stride[k] = step;
            step *= shape[k];
        }
    }
    constexpr View(T* data_, std::array<i64, N> shape_, std::array<i64, N> stride_)
        : data(data_), shape(shape_), stride(stride_) {}
    // A view that may be written to is also one that may be read.
    template <class U>
        requires(std::is_const_v<T> && std::is_same_v<const U, T>)
    constexpr View(const View<U, N>& other) : data(other.data), shape(other.shape), stride(other.stride) {}

    constexpr i64 size() const { return shape[0]; }

    template <class... Indices>
    constexpr T& operator()(Indices... indices) const {
        static_assert(sizeof...(Indices) == N);
        return data[offset(std::index_sequence_for<Indices...>{}, static_cast<i64>(indices)...)];
    }

    constexpr T& operator[](i64 i) const
        requires(N == 1)
    {
        check(i, 0);
        return data[i];
    }

    // The row, or block, number i.
    constexpr View<T, N - 1> operator[](i64 i) const
        requires(N > 1)
    {
        check(i, 0);
        View<T, N - 1> row;
        row.data = data + i * stride[0];
        for (std::size_t k = 1; k < N; ++k) {
            row.shape[k - 1] = shape[k];
            row.stride[k - 1] = stride[k];
        }
        return row;
    }

    constexpr T* begin() const
        requires(N == 1)
    {
        return data;
    }
    constexpr T* end() const
        requires(N == 1)
    {
        return data + shape[0];
    }
    // Elements first to last - 1 of one dimension.
    constexpr View<T, 1> slice(i64 first, i64 last) const
        requires(N == 1)
    {
#ifdef FLEET2D_CHECKS
        if (first < 0 || last < first || last > shape[0]) std::abort();
#endif
        return View<T, 1>(data + first, {last - first});
    }

private:
    constexpr void check([[maybe_unused]] i64 i, [[maybe_unused]] std::size_t dimension) const {
#ifdef FLEET2D_CHECKS
        if (i < 0 || i >= shape[dimension]) std::abort();
#endif
    }

    template <std::size_t... K, class... Indices>
    constexpr i64 offset(std::index_sequence<K...>, Indices... indices) const {
        (check(indices, K), ...);
        return ((K + 1 == N ? indices : indices * stride[K]) + ...);
    }
};

// An array that owns its memory; C-contiguous.
template <class T, std::size_t N = 1>
class Array {
public:
    Array() = default;

    // An array whose elements are not set yet.
    static Array empty(std::array<i64, N> shape) {
        Array result;
        result.shape_ = shape;
        result.data_ = std::make_unique_for_overwrite<T[]>(static_cast<std::size_t>(result.count()));
        return result;
    }

    static Array filled(std::array<i64, N> shape, T value) {
        Array result = empty(shape);
        std::fill_n(result.data_.get(), result.count(), value);
        return result;
    }

    static Array zeros(std::array<i64, N> shape) { return filled(shape, T{}); }

    static Array copy_of(View<const T, N> view) {
        Array result = empty(view.shape);
        copy_into(view, result.view());
        return result;
    }

    View<T, N> view() { return {data_.get(), shape_}; }
    View<const T, N> view() const { return {data_.get(), shape_}; }
    operator View<T, N>() { return view(); }
    operator View<const T, N>() const { return view(); }

    i64 size() const { return shape_[0]; }
    const std::array<i64, N>& shape() const { return shape_; }
    T* data() { return data_.get(); }
    const T* data() const { return data_.get(); }

    template <class... Indices>
    T& operator()(Indices... indices) {
        return view()(indices...);
    }
    decltype(auto) operator[](i64 i) { return view()[i]; }
    decltype(auto) operator[](i64 i) const { return view()[i]; }

    // Keep only the first `rows`; the memory of the others stays allocated.
    void truncate(i64 rows) { shape_[0] = rows; }

    // Make room for at least `rows`, keeping the first `used`.
    void grow(i64 rows, i64 used) {
        if (rows <= shape_[0]) return;
        std::array<i64, N> shape = shape_;
        shape[0] = rows > 2 * shape_[0] ? rows : 2 * shape_[0];
        Array larger = empty(shape);
        const i64 width = shape_[0] > 0 ? count() / shape_[0] : 0;
        std::copy_n(data_.get(), used * width, larger.data_.get());
        *this = std::move(larger);
    }

    // Release the memory to an owner that deletes it with delete[].
    T* release() { return data_.release(); }

private:
    i64 count() const {
        i64 product = 1;
        for (i64 length : shape_) product *= length;
        return product;
    }

    static void copy_into(View<const T, N> from, View<T, N> to) {
        if constexpr (N == 1) {
            std::copy(from.begin(), from.end(), to.begin());
        } else {
            for (i64 i = 0; i < from.size(); ++i) Array<T, N - 1>::copy_into(from[i], to[i]);
        }
    }
    template <class, std::size_t>
    friend class Array;

    std::unique_ptr<T[]> data_;
    std::array<i64, N> shape_{};
};

}  // namespace fleet2d
