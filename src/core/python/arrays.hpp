// The border between Python and the core: NumPy arrays become views, named tuples become structs,
// arrays that kernels return become NumPy arrays that own them. Nothing else knows Python's C API.
//
// An argument has to have the data type and the number of dimensions that its view has. One that is
// only read may lie in memory in any order: it is copied if its last dimension isn't contiguous.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL fleet2d_numpy
#ifndef FLEET2D_IMPORTS_NUMPY
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "../array.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fleet2d {

// Other threads run Python while a kernel does that takes longer than a microsecond.
using Unlocked = nb::call_guard<nb::gil_scoped_release>;

// What holds for arguments beyond their types; a ValueError in Python.
inline void require(bool holds, const char* message) {
    if (!holds) throw std::invalid_argument(message);
}

// Whether all numbers are in [first, last).
template <class T>
bool all_in_range(View<const T, 1> numbers, i64 first, i64 last) {
    bool inside = true;
    for (const T number : numbers) inside &= static_cast<i64>(number) >= first && static_cast<i64>(number) < last;
    return inside;
}
template <class T, std::size_t N>
    requires(N > 1)
bool all_in_range(View<const T, N> numbers, i64 first, i64 last) {
    for (i64 i = 0; i < numbers.size(); ++i) {
        if (!all_in_range(numbers[i], first, last)) return false;
    }
    return true;
}

// What a kernel has collected, as an array.
template <class T>
Array<T> array_of(const std::vector<T>& values) {
    return Array<T>::copy_of({values.data(), {static_cast<i64>(values.size())}});
}

namespace border {

// The number that NumPy has for the type of an array's elements.
template <class T>
inline constexpr int type_number = NPY_VOID;
template <>
inline constexpr int type_number<bool> = NPY_BOOL;
template <>
inline constexpr int type_number<i8> = NPY_INT8;
template <>
inline constexpr int type_number<i16> = NPY_INT16;
template <>
inline constexpr int type_number<i32> = NPY_INT32;
template <>
inline constexpr int type_number<i64> = NPY_INT64;
template <>
inline constexpr int type_number<u8> = NPY_UINT8;
template <>
inline constexpr int type_number<u16> = NPY_UINT16;
template <>
inline constexpr int type_number<u64> = NPY_UINT64;
template <>
inline constexpr int type_number<f64> = NPY_FLOAT64;

// NumPy's letter for it: the number differs between types of the same size and kind.
template <class T>
inline constexpr char type_kind = std::is_same_v<T, bool>       ? 'b'
                                  : std::is_floating_point_v<T> ? 'f'
                                  : std::is_signed_v<T>         ? 'i'
                                                                : 'u';

// Read `source` into a view. `copy` owns the memory afterwards if it had to be copied.
template <class T, std::size_t N>
bool view_of(nb::handle source, View<T, N>& view, nb::object& copy) noexcept {
    if (!PyArray_Check(source.ptr())) return false;
    auto* array = reinterpret_cast<PyArrayObject*>(source.ptr());
    constexpr npy_intp size = sizeof(T);
    if (PyArray_NDIM(array) != static_cast<int>(N) || PyArray_DESCR(array)->kind != type_kind<std::remove_const_t<T>> ||
        PyArray_ITEMSIZE(array) != size || !PyArray_ISNOTSWAPPED(array)) {
        return false;
    }
    if (!std::is_const_v<T> && !PyArray_ISWRITEABLE(array)) return false;
    const auto fits = [](PyArrayObject* a) {
        if (!PyArray_ISALIGNED(a)) return false;
        if (PyArray_SIZE(a) <= 1) return true;
        for (std::size_t k = 0; k + 1 < N; ++k) {
            if (PyArray_STRIDE(a, static_cast<int>(k)) % size != 0) return false;
        }
        return PyArray_DIM(a, N - 1) <= 1 || PyArray_STRIDE(a, N - 1) == size;
    };
    if (!fits(array)) {
        if (!std::is_const_v<T>) return false;
        copy = nb::steal(PyArray_NewCopy(array, NPY_CORDER));
        if (!copy.is_valid()) {
            PyErr_Clear();
            return false;
        }
        array = reinterpret_cast<PyArrayObject*>(copy.ptr());
    }
    view.data = static_cast<T*>(PyArray_DATA(array));
    for (std::size_t k = 0; k < N; ++k) {
        view.shape[k] = PyArray_DIM(array, static_cast<int>(k));
        view.stride[k] = PyArray_STRIDE(array, static_cast<int>(k)) / size;
    }
    view.stride[N - 1] = 1;
    return true;
}

// A read-only NumPy array of memory that belongs to an object of Python.
template <class T, std::size_t N>
struct ReadOnly {
    nb::object array;
};

template <class T, std::size_t N>
ReadOnly<T, N> borrowed(View<const T, N> view, nb::handle owner) {
    npy_intp shape[N];
    for (std::size_t k = 0; k < N; ++k) shape[k] = view.shape[k];
    PyObject* array = PyArray_New(&PyArray_Type, static_cast<int>(N), shape, type_number<T>, nullptr,
                                  const_cast<T*>(view.data), 0, NPY_ARRAY_C_CONTIGUOUS | NPY_ARRAY_ALIGNED, nullptr);
    if (array == nullptr) throw nb::python_error();
    Py_INCREF(owner.ptr());
    if (PyArray_SetBaseObject(reinterpret_cast<PyArrayObject*>(array), owner.ptr()) < 0) throw nb::python_error();
    return {nb::steal(array)};
}

// A NumPy array that owns what a kernel returned.
template <class T, std::size_t N>
nb::handle handed_over(Array<T, N>&& values) noexcept {
    npy_intp shape[N];
    for (std::size_t k = 0; k < N; ++k) shape[k] = values.shape()[k];
    T* data = values.release();
    PyObject* array = PyArray_New(&PyArray_Type, static_cast<int>(N), shape, type_number<T>, nullptr, data, 0,
                                  NPY_ARRAY_CARRAY, nullptr);
    PyObject* owner = array == nullptr ? nullptr : PyCapsule_New(data, nullptr, [](PyObject* capsule) {
        delete[] static_cast<T*>(PyCapsule_GetPointer(capsule, nullptr));
    });
    if (owner == nullptr) {
        delete[] data;
        Py_XDECREF(array);
        return {};
    }
    if (PyArray_SetBaseObject(reinterpret_cast<PyArrayObject*>(array), owner) < 0) {
        Py_DECREF(array);
        return {};
    }
    return array;
}

// The number of members of a struct that comes from Python as a named tuple, whose fields they are in their order.
template <class S>
inline constexpr std::size_t members_of = 0;

template <class S>
concept ComesAsNamedTuple = members_of<S> != 0;

// References to all members of such a struct.
template <ComesAsNamedTuple S>
constexpr auto references_to(S& values) {
    if constexpr (members_of<S> == 2) {
        auto& [a, b] = values;
        return std::tie(a, b);
    }
    if constexpr (members_of<S> == 3) {
        auto& [a, b, c] = values;
        return std::tie(a, b, c);
    }
    if constexpr (members_of<S> == 4) {
        auto& [a, b, c, d] = values;
        return std::tie(a, b, c, d);
    }
    if constexpr (members_of<S> == 5) {
        auto& [a, b, c, d, e] = values;
        return std::tie(a, b, c, d, e);
    }
    if constexpr (members_of<S> == 6) {
        auto& [a, b, c, d, e, f] = values;
        return std::tie(a, b, c, d, e, f);
    }
    if constexpr (members_of<S> == 7) {
        auto& [a, b, c, d, e, f, g] = values;
        return std::tie(a, b, c, d, e, f, g);
    }
    if constexpr (members_of<S> == 8) {
        auto& [a, b, c, d, e, f, g, h] = values;
        return std::tie(a, b, c, d, e, f, g, h);
    }
    if constexpr (members_of<S> == 10) {
        auto& [a, b, c, d, e, f, g, h, i, j] = values;
        return std::tie(a, b, c, d, e, f, g, h, i, j);
    }
    if constexpr (members_of<S> == 18) {
        auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r] = values;
        return std::tie(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r);
    }
}

template <class T>
inline constexpr bool is_view = false;
template <class T, std::size_t N>
inline constexpr bool is_view<View<T, N>> = true;

// What refers to memory of Python, or to a copy that its caster owns.
template <class T>
concept Borrows = is_view<T> || ComesAsNamedTuple<T>;

}  // namespace border
}  // namespace fleet2d

// nanobind's extension point for types of one's own.
namespace nanobind::detail {

// The array in signatures.
template <class T>
constexpr auto array_name =
    const_name("numpy.typing.NDArray[numpy.") +
    const_name<std::is_same_v<T, bool>>(
        const_name("bool_"),
        const_name<std::is_floating_point_v<T>>(const_name("float"), const_name<std::is_signed_v<T>>("int", "uint")) +
            const_name<8 * sizeof(T)>()) +
    const_name("]");

template <class T, std::size_t N>
struct type_caster<fleet2d::View<T, N>> {
    using V = fleet2d::View<T, N>;
    NB_TYPE_CASTER(V, array_name<std::remove_const_t<T>>)
    object copy;

    bool from_python(handle source, uint32_t, cleanup_list*) noexcept {
        return fleet2d::border::view_of(source, value, copy);
    }
};

// nanobind's own caster of optional values would free the copy before the call.
template <class T>
    requires fleet2d::border::Borrows<T>
struct type_caster<std::optional<T>> {
    using V = std::optional<T>;
    using Caster = make_caster<T>;
    NB_TYPE_CASTER(V, optional_name(Caster::Name))
    Caster caster;

    bool from_python(handle source, uint32_t flags, cleanup_list* cleanup) noexcept {
        if (source.is_none()) {
            value.reset();
            return true;
        }
        if (!caster.from_python(source, flags, cleanup)) return false;
        value = caster.value;
        return true;
    }
};

template <class T, std::size_t N>
struct type_caster<fleet2d::Array<T, N>> {
    using A = fleet2d::Array<T, N>;
    NB_TYPE_CASTER(A, array_name<T>)

    static handle from_cpp(A&& values, rv_policy, cleanup_list*) noexcept {
        return fleet2d::border::handed_over(std::move(values));
    }
};

template <class T, std::size_t N>
struct type_caster<fleet2d::border::ReadOnly<T, N>> {
    using R = fleet2d::border::ReadOnly<T, N>;
    NB_TYPE_CASTER(R, array_name<T>)

    static handle from_cpp(R&& borrowed, rv_policy, cleanup_list*) noexcept { return borrowed.array.release(); }
};

template <class S>
    requires fleet2d::border::ComesAsNamedTuple<S>
struct type_caster<S> {
    NB_TYPE_CASTER(S, const_name("tuple[typing.Any, ...]"))

    static constexpr std::size_t count = fleet2d::border::members_of<S>;
    template <class... M>
    static std::tuple<make_caster<M>...> casters_of(std::tuple<M&...>);
    decltype(casters_of(fleet2d::border::references_to(std::declval<S&>()))) casters;  // they own what had to be copied

    bool from_python(handle source, uint32_t flags, cleanup_list* cleanup) noexcept {
        if (!PyTuple_Check(source.ptr()) || PyTuple_Size(source.ptr()) != static_cast<Py_ssize_t>(count)) return false;
        return [&]<std::size_t... K>(std::index_sequence<K...>) {
            return (read<K>(source, flags, cleanup) && ...);
        }(std::make_index_sequence<count>{});
    }

    template <std::size_t K>
    bool read(handle source, uint32_t flags, cleanup_list* cleanup) noexcept {
        auto& member = std::get<K>(fleet2d::border::references_to(value));
        auto& caster = std::get<K>(casters);
        if (!caster.from_python(PyTuple_GetItem(source.ptr(), K), flags, cleanup)) return false;
        member = static_cast<std::remove_reference_t<decltype(member)>&>(caster);
        return true;
    }
};

}  // namespace nanobind::detail
