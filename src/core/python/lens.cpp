#include "lens.hpp"

#include "../occlusion.hpp"
#include "mesh.hpp"
#include "subjects.hpp"

namespace fleet2d {
namespace {

constexpr i64 FARTHEST_SIGHT = 1 << 26;  // see within_radius

void check_camera(const Lenses& lenses, i64 camera) {
    check_lenses(lenses);
    require(0 <= camera && camera < lenses.near_squared.size(), "there is no such camera");
}

}  // namespace

void bind_lens(nb::module_& m) {
    m.def("near_wedge", &near_wedge, "heading"_a, "half_angle"_a, "dx"_a, "dy"_a, "reach"_a,
          "Return whether anything within `reach` of (dx, dy) may lie in a wedge; exact at reach 0.");
    m.def("in_wedge", &in_wedge, "heading"_a, "half_angle"_a, "dx"_a, "dy"_a,
          "Return whether (dx, dy) lies within `half_angle` [1/8192 turn] of a heading, or on the border.");
    m.def(
        "camera_pose",
        [](const Lenses& lenses, i64 camera, i64 x, i64 y, i64 heading, i64 moment_us) {
            check_camera(lenses, camera);
            const Pose pose = camera_pose(lenses, camera, {x, y, heading}, moment_us);
            return std::tuple(pose.x, pose.y, pose.heading);
        },
        "lenses"_a, "camera"_a, "x"_a, "y"_a, "heading"_a, "moment_us"_a,
        "Return where a camera is and where it looks; the offset is rounded to the lattice.");
    m.def(
        "hides",
        [](i64 px, i64 py, i64 bx, i64 by, i64 radius) {
            for (const i64 value : {px, py, bx, by})
                require(-FARTHEST_SIGHT <= value && value <= FARTHEST_SIGHT, "points must be nearer");
            require(0 < radius && radius < FATTEST, "radius must be in 1 to 2**17 - 1");
            return hides(px, py, bx, by, radius);
        },
        "px"_a, "py"_a, "bx"_a, "by"_a, "radius"_a,
        R"(Return whether a body hides a point, both from the eye [lattice units].

The point of the sight line that is nearest to the body's centre lies between the ends, neither
included, and not farther from it than its radius.)");
    m.def(
        "points_in_view",
        [](const Mesh& walls, const Lenses& lenses, i64 camera, i64 user, i64 x, i64 y, i64 heading, i64 dx, i64 dy) {
            check_camera(lenses, camera);
            require(0 <= user && user < lenses.bodies.shape[1], "there is no such user");
            require(lenses.points[camera] < 64, "a body must have at most 64 points");
            return points_in_view(walls, lenses, camera, user, {x, y, heading}, locate(walls, x, y), dx, dy);
        },
        "walls"_a, "lenses"_a, "camera"_a, "user"_a, "x"_a, "y"_a, "heading"_a, "dx"_a, "dy"_a,
        "Return which points of a user's body are in view of a camera, bit i for number i; its centre is at (dx, dy).");
}

}  // namespace fleet2d
