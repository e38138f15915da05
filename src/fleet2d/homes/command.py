"""`fleet2d convert`: homes in our own format, and for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from fleet2d.options import Resolution, Scale


def convert(
    source: Annotated[
        Path, typer.Argument(metavar="FLOORPLAN", help="A floor plan of any format.")
    ],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="The file to write: .json or .yaml of our own, .geojson, .pgm with a .yaml beside"
            " it for ROS's map_server, or .sdf for Gazebo.",
        ),
    ],
    resolution: Resolution = None,
    scale: Scale = None,
) -> None:
    """Convert a floor plan to our format, or for other programs.

    What is odd or lost is listed.

    Examples:
      fleet2d convert flat.dxf flat.json --scale 0.001
      fleet2d convert flat.json map.pgm
      fleet2d convert synthetic:7 home.sdf
    """
    from fleet2d.floorplan.load import load_floorplan, save_floorplan
    from fleet2d.homes.for_robots import left_out_for_robots, save_map, save_world

    plan = load_floorplan(source, resolution=resolution, scale=scale)
    for_robots = {".pgm": save_map, ".sdf": save_world}.get(target.suffix.lower())
    save = for_robots or save_floorplan
    save(plan, target)
    lost = [left_out_for_robots(plan)] if for_robots else []
    for note in [*plan.notes, *lost]:
        typer.echo(f"note: {note}")
    typer.echo(target)
