// Meshes as Python holds them.
#pragma once

#include "../mesh.hpp"
#include "arrays.hpp"

namespace fleet2d {

// A mesh that owns its arrays. It never changes, so threads and homes may share it.
class OwnedMesh {
public:
    // Raises ValueError: an array isn't what `Mesh` says, or doesn't fit the others.
    OwnedMesh(View<const i64, 2> vertices, View<const i32, 2> triangles, View<const i32, 2> neighbors);

    const Mesh& mesh() const { return mesh_; }

private:
    Array<i64, 2> vertices_;
    Array<i32, 2> triangles_;
    Array<i32, 2> neighbors_;
    Buckets buckets_;
    Array<Beyond> beyond_;
    Mesh mesh_;
};

}  // namespace fleet2d

namespace nanobind::detail {

template <>
struct type_caster<fleet2d::Mesh> {
    NB_TYPE_CASTER(fleet2d::Mesh, const_name("Mesh"))

    bool from_python(handle source, uint32_t, cleanup_list*) noexcept {
        fleet2d::OwnedMesh* owned = nullptr;
        if (!nb::try_cast(source, owned) || owned == nullptr) return false;
        value = owned->mesh();
        return true;
    }
};

}  // namespace nanobind::detail
