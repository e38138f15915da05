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

namespace border {

template <class T>
struct DataType;  // kind and number as NumPy has them, and the name of the array in signatures
template <>
struct DataType<bool> {
    static constexpr char kind = 'b';
    static constexpr int number = NPY_BOOL;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.bool_]");
};
template <>
struct DataType<i8> {
    static constexpr char kind = 'i';
    static constexpr int number = NPY_INT8;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.int8]");
};
template <>
struct DataType<i16> {
    static constexpr char kind = 'i';
    static constexpr int number = NPY_INT16;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.int16]");
};
template <>
struct DataType<i32> {
    static constexpr char kind = 'i';
    static constexpr int number = NPY_INT32;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.int32]");
};
template <>
struct DataType<i64> {
    static constexpr char kind = 'i';
    static constexpr int number = NPY_INT64;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.int64]");
};
template <>
struct DataType<u8> {
    static constexpr char kind = 'u';
    static constexpr int number = NPY_UINT8;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.uint8]");
};
template <>
struct DataType<u16> {
    static constexpr char kind = 'u';
    static constexpr int number = NPY_UINT16;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.uint16]");
};
template <>
struct DataType<u64> {
    static constexpr char kind = 'u';
    static constexpr int number = NPY_UINT64;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.uint64]");
};
template <>
struct DataType<f64> {
    static constexpr char kind = 'f';
    static constexpr int number = NPY_FLOAT64;
    static constexpr auto name = nb::detail::const_name("numpy.typing.NDArray[numpy.float64]");
};

// Read `source` into a view. `copy` owns the memory afterwards if it had to be copied.
template <class T, std::size_t N>
bool view_of(nb::handle source, View<T, N>& view, nb::object& copy) noexcept {
    using Type = DataType<std::remove_const_t<T>>;
    if (!PyArray_Check(source.ptr())) return false;
    auto* array = reinterpret_cast<PyArrayObject*>(source.ptr());
    constexpr npy_intp size = sizeof(T);
    if (PyArray_NDIM(array) != static_cast<int>(N) || PyArray_DESCR(array)->kind != Type::kind ||
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

// A read-only NumPy array of memory that belongs to `owner`.
template <class T, std::size_t N>
nb::object borrowed(View<const T, N> view, nb::handle owner) {
    npy_intp shape[N];
    for (std::size_t k = 0; k < N; ++k) shape[k] = view.shape[k];
    PyObject* array = PyArray_New(&PyArray_Type, static_cast<int>(N), shape, DataType<T>::number, nullptr,
                                  const_cast<T*>(view.data), 0, NPY_ARRAY_C_CONTIGUOUS | NPY_ARRAY_ALIGNED, nullptr);
    if (array == nullptr) throw nb::python_error();
    Py_INCREF(owner.ptr());
    if (PyArray_SetBaseObject(reinterpret_cast<PyArrayObject*>(array), owner.ptr()) < 0) throw nb::python_error();
    return nb::steal(array);
}

// A NumPy array that owns what a kernel returned.
template <class T, std::size_t N>
nb::handle handed_over(Array<T, N>&& values) noexcept {
    npy_intp shape[N];
    for (std::size_t k = 0; k < N; ++k) shape[k] = values.shape()[k];
    T* data = values.release();
    PyObject* array = PyArray_New(&PyArray_Type, static_cast<int>(N), shape, DataType<T>::number, nullptr, data, 0,
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

// Structs that come from Python as named tuples: specialised with `name`, and with `members`, a
// std::tuple of pointers to the members in the tuple's order.
template <class S>
struct Fields;

template <class S>
concept ComesAsNamedTuple = requires { Fields<S>::members; };

template <class M>
struct Member;
template <class S, class T>
struct Member<T S::*> {
    using Type = T;
};

}  // namespace border
}  // namespace fleet2d

namespace nanobind::detail {

template <class T, std::size_t N>
struct type_caster<fleet2d::View<T, N>> {
    using V = fleet2d::View<T, N>;
    NB_TYPE_CASTER(V, fleet2d::border::DataType<std::remove_const_t<T>>::name)
    object copy;

    bool from_python(handle source, uint32_t, cleanup_list*) noexcept {
        return fleet2d::border::view_of(source, value, copy);
    }
};

// nanobind's own caster of optional values would free the copy before the call.
template <class T, std::size_t N>
struct type_caster<std::optional<fleet2d::View<T, N>>> {
    using V = std::optional<fleet2d::View<T, N>>;
    using Caster = make_caster<fleet2d::View<T, N>>;
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
    NB_TYPE_CASTER(A, fleet2d::border::DataType<T>::name)

    static handle from_cpp(A&& values, rv_policy, cleanup_list*) noexcept {
        return fleet2d::border::handed_over(std::move(values));
    }
};

template <class S>
    requires fleet2d::border::ComesAsNamedTuple<S>
struct type_caster<S> {
    NB_TYPE_CASTER(S, fleet2d::border::Fields<S>::name)

    static constexpr auto members = fleet2d::border::Fields<S>::members;
    static constexpr std::size_t count = std::tuple_size_v<decltype(members)>;
    template <class... M>
    static std::tuple<make_caster<typename fleet2d::border::Member<M>::Type>...> casters_of(std::tuple<M...>);
    decltype(casters_of(members)) casters;  // they own what had to be copied

    bool from_python(handle source, uint32_t flags, cleanup_list* cleanup) noexcept {
        if (!PyTuple_Check(source.ptr()) || PyTuple_Size(source.ptr()) != static_cast<Py_ssize_t>(count)) return false;
        return [&]<std::size_t... K>(std::index_sequence<K...>) {
            return (read<K>(source, flags, cleanup) && ...);
        }(std::make_index_sequence<count>{});
    }

    template <std::size_t K>
    bool read(handle source, uint32_t flags, cleanup_list* cleanup) noexcept {
        constexpr auto member = std::get<K>(members);
        using T = typename fleet2d::border::Member<std::remove_const_t<decltype(member)>>::Type;
        auto& caster = std::get<K>(casters);
        if (!caster.from_python(PyTuple_GetItem(source.ptr(), K), flags, cleanup)) return false;
        value.*member = static_cast<T&>(caster);
        return true;
    }
};

}  // namespace nanobind::detail
