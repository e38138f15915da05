"""Read a floor plan from whatever names one: a file of a known format, or a bundled home."""

from pathlib import Path

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.bundled import HOMES, bundled_names
from fleet2d.floorplan.houseexpo import read_houseexpo
from fleet2d.floorplan.native import FORMAT, read_native
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.ros import read_ros
from fleet2d.floorplan.source import read_json
from fleet2d.floorplan.valetudo import read_valetudo
from fleet2d.floorplan.valetudo_file import MAP_CLASS
from fleet2d.problems import did_you_mean

USUAL_CELL_M = 0.05
YAML = (".yaml", ".yml")
IMAGES = (".pgm", ".png")


def load_floorplan(plan: str | Path = "family_home", cell: float | None = None) -> FloorPlan:
    """Read a floor plan.

    Args:
        plan: A file, whose content tells its format (YAML is a ROS map), or the name of a
            bundled home.
        cell: Side of a grid cell [m]; None for 0.05, or for a robot's map its resolution.

    Raises:
        FloorPlanError: There is no such plan, or it can't be read.

    Example:
        >>> load_floorplan().name
        'family_home'
    """
    names = bundled_names()
    if str(plan) in names:
        return read_native(HOMES / f"{plan}.json", USUAL_CELL_M if cell is None else cell)
    path = Path(plan)
    if not path.exists() and path.suffix == "" and path.name == str(plan):
        raise FloorPlanError(
            f"there is no floor plan file {plan!r}, and no bundled home of that name"
            f"{did_you_mean(plan, names)} Bundled homes: {', '.join(names)}"
        )
    if path.suffix.lower() in YAML:
        return read_ros(path, cell)
    if path.suffix.lower() in IMAGES and path.is_file():
        raise FloorPlanError(
            f"{path} is the image of a map, without its scale: name the YAML file that goes with"
            f" it, such as {path.with_suffix('.yaml').name}"
        )
    return _load_json(path, cell)


def _load_json(path: Path, cell: float | None) -> FloorPlan:
    usual = USUAL_CELL_M if cell is None else cell
    content = read_json(path)
    if content.get("format") == FORMAT:
        return read_native(path, usual)
    if "verts" in content:
        return read_houseexpo(path, usual)
    if content.get("__class") == MAP_CLASS:
        return read_valetudo(path, cell)
    raise FloorPlanError(
        f"{path} is no floor plan that Fleet2D knows: it has neither `verts` (HouseExpo) nor"
        f' "format": "{FORMAT}", nor "__class": "{MAP_CLASS}"'
    )
