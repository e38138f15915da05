#include "arrays.hpp"
#include "subjects.hpp"

namespace fleet2d {

void bind_region(nb::module_&) {}

}  // namespace fleet2d
