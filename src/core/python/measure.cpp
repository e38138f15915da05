#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_measure(nb::module_&) {}

}  // namespace fleet2d
