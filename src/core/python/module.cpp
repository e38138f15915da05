// The module fleet2d._core.
#define FLEET2D_IMPORTS_NUMPY
#include "arrays.hpp"
#include "subjects.hpp"

NB_MODULE(_core, m) {
    using namespace fleet2d;
    if (_import_array() < 0) throw nb::python_error();
    m.doc() = "The compiled core of Fleet2D: arrays and integers in, arrays and integers out.";
    // Homes that a process keeps to its end hold meshes and routes: that is no leak.
    nb::set_leak_warnings(false);
    bind_mesh(m);
    bind_headings(m);
    bind_random(m);
    bind_lens(m);
    bind_line_of_sight(m);
    bind_chambers(m);
    bind_masks(m);
    bind_fields(m);
    bind_furniture(m);
    bind_layouts(m);
    bind_moved_walls(m);
    bind_obstacles(m);
    bind_taut(m);
    bind_region(m);
    bind_visible_cells(m);
    bind_coverage(m);
    bind_motion(m);
    bind_measure(m);
    bind_points(m);
    bind_perception(m);
    bind_detections(m);
    bind_routes(m);
    bind_presence(m);
    bind_evidence(m);
    bind_legs(m);
    bind_stays(m);
    bind_people(m);
    bind_traces(m);
    bind_smoothing(m);
    bind_timelines(m);
    bind_giving_way(m);
    bind_signals(m);
    bind_flows(m);
    bind_interruptions(m);
    bind_planner(m);
    bind_residents(m);
    bind_battery(m);
    bind_room_memory(m);
    bind_encoding(m);
}
