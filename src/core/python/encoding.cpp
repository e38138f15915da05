#include "../encoding.hpp"

#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

struct AnyArray {
    Values values;
    nb::object copy;  // owns the memory if it had to be copied
};

template <class T>
bool read_as(nb::handle source, Values::Type type, AnyArray& array) noexcept {
    View<const T> view;
    if (!border::view_of(source, view, array.copy)) return false;
    array.values = {view.data, view.size(), type};
    return true;
}

}  // namespace
}  // namespace fleet2d

namespace nanobind::detail {

template <>
struct type_caster<fleet2d::AnyArray> {
    NB_TYPE_CASTER(fleet2d::AnyArray, const_name("numpy.typing.NDArray[typing.Any]"))

    bool from_python(handle source, uint32_t, cleanup_list*) noexcept {
        using fleet2d::read_as;
        using Type = fleet2d::Values::Type;
        return read_as<fleet2d::i32>(source, Type::INT32, value) || read_as<fleet2d::i64>(source, Type::INT64, value) ||
               read_as<fleet2d::f64>(source, Type::FLOAT64, value) || read_as<bool>(source, Type::BOOL, value) ||
               read_as<fleet2d::u8>(source, Type::TEXT, value);
    }
};

}  // namespace nanobind::detail

namespace fleet2d {

void bind_encoding(nb::module_& m) {
    m.def(
        "encode_arrays",
        [](const std::vector<AnyArray>& arrays) {
            std::vector<Values> columns;
            for (const AnyArray& array : arrays) columns.push_back(array.values);
            auto bytes = Array<u8>::empty({most_bytes(columns)});
            const i64 size = encode_arrays(columns, bytes.view().data);
            return nb::bytes(bytes.view().data, static_cast<std::size_t>(size));
        },
        "arrays"_a,
        R"(Return arrays as bytes: values that repeat or grow slowly take few.

Args:
    arrays: Arrays (n,) of int32, int64, float64, bool, or uint8 for text.

Returns:
    For each array a header and its values; see `fleet2d.artifacts.unfinished`.)");
}

}  // namespace fleet2d
