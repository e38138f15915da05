// One function for each subject of the core that adds it to the module.
#pragma once

#include <nanobind/nanobind.h>

namespace fleet2d {

void bind_mesh(nanobind::module_& m);
void bind_headings(nanobind::module_& m);
void bind_random(nanobind::module_& m);
void bind_lens(nanobind::module_& m);
void bind_line_of_sight(nanobind::module_& m);
void bind_chambers(nanobind::module_& m);
void bind_masks(nanobind::module_& m);
void bind_fields(nanobind::module_& m);
void bind_furniture(nanobind::module_& m);
void bind_layouts(nanobind::module_& m);
void bind_moved_walls(nanobind::module_& m);
void bind_obstacles(nanobind::module_& m);
void bind_taut(nanobind::module_& m);
void bind_giving_way(nanobind::module_& m);
void bind_timelines(nanobind::module_& m);
void bind_region(nanobind::module_& m);
void bind_visible_cells(nanobind::module_& m);
void bind_coverage(nanobind::module_& m);
void bind_motion(nanobind::module_& m);
void bind_measure(nanobind::module_& m);
void bind_points(nanobind::module_& m);
void bind_perception(nanobind::module_& m);
void bind_detections(nanobind::module_& m);
void bind_routes(nanobind::module_& m);
void bind_presence(nanobind::module_& m);
void bind_evidence(nanobind::module_& m);
void bind_legs(nanobind::module_& m);
void bind_stays(nanobind::module_& m);
void bind_people(nanobind::module_& m);
void bind_traces(nanobind::module_& m);
void bind_smoothing(nanobind::module_& m);
void bind_signals(nanobind::module_& m);
void bind_flows(nanobind::module_& m);
void bind_interruptions(nanobind::module_& m);
void bind_planner(nanobind::module_& m);
void bind_residents(nanobind::module_& m);
void bind_battery(nanobind::module_& m);
void bind_room_memory(nanobind::module_& m);
void bind_encoding(nanobind::module_& m);

}  // namespace fleet2d
