"""The facts of a run that the page receives: everything except its tables."""

import math
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime, time, timedelta
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fleet2d import __version__
from fleet2d.artifacts.manifest import plain
from fleet2d.artifacts.table import LAYER_PREFIX, categories
from fleet2d.configuration.units import micros, parse_duration
from fleet2d.engine.access import interventions_of
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.home_object import Door
from fleet2d.errors import ArtifactError, errors_as
from fleet2d.floorplan.slow_area import SlowArea
from fleet2d.kernels import I64, Bool
from fleet2d.palette import body_color
from fleet2d.runs.run import Run
from fleet2d.runs.verdicts import verdict_line, verdicts_of, violations_of
from fleet2d.runtime.clock import TWILIGHT, Clock, Sun
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.local_time import EPOCH, even_parts, stamp_us, written
from fleet2d.scenario.model import Daylight
from fleet2d.sight.camera import DEFAULT_ANGLE_DEG, DEFAULT_RANGE_M
from fleet2d.sight.perception import DARK_NIGHT
from fleet2d.storage.files import path_in
from fleet2d.viewing.contract import (
    BodyFacts,
    CameraFacts,
    ColumnFacts,
    HomeFacts,
    MarkFacts,
    RunFacts,
    SightingFacts,
    SlowFacts,
    TableFacts,
    VerdictFacts,
    WallsChange,
)
from fleet2d.viewing.home_facts import WallsHistory, door_facts, home_facts
from fleet2d.viewing.story import story_of

INTERVENTIONS = "interventions"


def marks_of(run: Run) -> list[MarkFacts]:
    """Return the marks of a run's interventions and expectations.

    Raises:
        ArtifactError: The table of violations is damaged.
    """
    manifest = run.manifest
    marks = intervention_marks(manifest.get("interventions") or ())
    verdicts = manifest.get("expectations") or {}
    violations = violations_of(run) if verdicts else {}
    for name, verdict in verdicts.items():
        marks += expectation_marks(name, verdict, violations.get(name, []), manifest["steps"])
    return marks


def intervention_marks(records: Iterable[Mapping[str, Any]]) -> list[MarkFacts]:
    """Return the marks of interventions, from the records of a manifest."""
    return [
        MarkFacts(
            lane=INTERVENTIONS,
            step=int(record["step"]),
            end=int(record["step"]) + 1,
            kind="intervention",
            label=intervention_label(record),
        )
        for record in records
    ]


def intervention_label(record: Mapping[str, Any]) -> str:
    """Return a short label of an intervention.

    >>> intervention_label({"do": "change", "step": 4, "change": {"shut": "bath_door", "at": None}})
    'shut bath_door'
    >>> intervention_label({"do": "put", "step": 4, "entity": "ana", "x": 5, "by": "script.0"})
    'put ana (script.0)'
    >>> change = {"entity": "astro", "behavior": "hangout", "keys": {"tau": "10 min"}}
    >>> intervention_label({"do": "configure", **change})
    'astro: hangout with tau 10 min'
    """
    parts = [value for key, value in record.items() if isinstance(value, str) and key != "by"]
    if isinstance(change := record.get("change"), Mapping):
        parts = next(([key, value] for key, value in change.items() if value), ["change"])
    elif isinstance(keys := record.get("keys"), Mapping):
        settings = ", ".join(f"{key} {value}" for key, value in keys.items())
        parts = [f"{record['entity']}: {record['behavior']} with {settings}"]
    by = f" ({record['by']})" if record.get("by") else ""
    return " ".join(str(part) for part in parts[:3]) + by


def slow_floors(
    scenario: Mapping[str, Any], records: Iterable[Mapping[str, Any]], clock: Clock
) -> list[SlowFacts]:
    """Return the floors that slow robots down, by a scenario and by records of interventions."""
    areas = scenario["floorplan"].get("slows", ())
    from_start = [{"do": "slow", "step": 0, **area} for area in areas]
    return slow_floors_of([*from_start, *records], clock)


def slow_floors_of(records: Iterable[Mapping[str, Any]], clock: Clock) -> list[SlowFacts]:
    """Return the floors that slow robots down since interventions."""
    floors = []
    for record in records:
        if record["do"] != "slow":
            continue
        step = int(record["step"])
        end = clock.steps
        duration = record.get("duration")
        if duration is not None:
            end = min(end, step + clock.step_at_or_after(micros(parse_duration(duration))))
        area = SlowArea(**{key: record[key] for key in SlowArea.model_fields if key in record})
        facts = SlowFacts(outline=list(area.area), words=_slow_words(area), step=step, end=end)
        floors.append(facts)
    return floors


def _slow_words(area: SlowArea) -> str:
    """Return the effect on robots of a floor that slows them down, in words."""
    parts = []
    if area.speed < 1:
        parts.append(f"robots drive at {area.speed:.0%}")
    if area.stop:
        parts.append(f"robots stop for {area.stop.total_seconds():g} s")
    return ", ".join(parts)


def starts_unlit(scenario: Mapping[str, Any]) -> bool:
    """Return whether people switch lights, in which case all are off at first."""
    return any(user.get("lights") for user in scenario.get("users", {}).values())


def expectation_marks(
    name: str, verdict: Mapping[str, Any], violations: Iterable[tuple[int, int]], steps: int
) -> list[MarkFacts]:
    """Return the stretches of a run in which an expectation held, or was violated.

    Args:
        name: The name of the expectation.
        verdict: The verdict of the manifest.
        violations: The first and last step of each violation, in order.
        steps: The number of steps of the run.

    Example:
        >>> marks = expectation_marks("quiet", {"holds": False}, [(10, 19)], 100)
        >>> [(mark["step"], mark["end"], mark["kind"]) for mark in marks]
        [(0, 10, 'held'), (10, 20, 'violated'), (20, 100, 'held')]
    """
    label = str(verdict.get("says") or verdict.get("expectation") or name)
    stretches: list[tuple[int, int, Literal["held", "violated", "open"]]] = []
    begin = 0
    for first, last in violations:
        stretches += [(begin, first, "held"), (max(begin, first), last + 1, "violated")]
        begin = max(begin, last + 1)
    holds = verdict.get("holds", True)  # None: it was never put to the test
    if not stretches and holds is False:
        stretches.append((begin, steps, "violated"))
    else:
        is_open = holds is None or not verdict.get("decided", True)
        stretches.append((begin, steps, "open" if is_open else "held"))
    return [
        MarkFacts(lane=name, step=step, end=end, kind=kind, label=label)
        for step, end, kind in stretches
        if end > step
    ]


JOIN_S = 6.0  # shorter gaps between sightings are no gaps in a lane


BATCH_ROWS = 1 << 18


def sightings_of(run: Run) -> list[SightingFacts]:
    """Return the stretches in which each robot noticed each user, in order.

    A year has ten million observations: they are read in batches, in the order of their steps.

    Raises:
        ArtifactError: The table of observations is damaged.
    """
    if "observations" not in run.tables:
        return []
    from fleet2d.artifacts.arrow import values_of

    gap = max(1, round(JOIN_S * 1e6 / run.manifest["step_us"]))
    lanes: dict[tuple[str, str], SightingFacts] = {}
    robots: dict[str, None] = {}  # a set in order of appearance
    users: dict[str, None] = {}
    for batch in _observations(run):
        robot, robot_names = categories(batch["robot"])
        user, user_names = categories(batch["user"])
        robots |= dict.fromkeys(robot_names)
        users |= dict.fromkeys(user_names)
        step = values_of(batch["step"])
        false = _are_false(batch)
        names = [*user_names, ""]  # the last is for unknown users
        for number, robot_name in enumerate(robot_names):
            for known, name in enumerate(names):
                rows = (robot == number) & (user % len(names) == known)
                if rows.any():
                    none = SightingFacts(robot=robot_name, user=name, first=[], last=[], false=[])
                    lane = lanes.setdefault((robot_name, name), none)
                    _extend(lane, step[rows], false[rows], gap)
    pairs = product(robots, (*users, ""))
    return [lanes[pair] for pair in pairs if pair in lanes]


def _observations(run: Run) -> Iterator[Any]:
    """Yield the table of observations in parts, with the columns that sightings need."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = ("step", "robot", "user", "true_user", "truth_known")
    path = None if run.directory is None else path_in(run.directory, "observations.parquet")
    if path is None or not path.is_file():
        yield run.tables["observations"]
        return
    with errors_as(ArtifactError, f"{path} can't be read", (pa.ArrowException, OSError)):
        file = pq.ParquetFile(path)
        names = [name for name in columns if name in file.schema_arrow.names]
        for batch in file.iter_batches(BATCH_ROWS, columns=names):
            yield pa.Table.from_batches([batch])


def _are_false(table: Any) -> Bool:
    """Return which observations are of something other than the user that the robot recognized."""
    import pyarrow.compute as pc

    from fleet2d.artifacts.arrow import values_of

    if "true_user" not in table.column_names:
        return np.zeros(table.num_rows, np.bool_)
    user, true_user = (pc.cast(table[name], "string") for name in ("user", "true_user"))
    is_mistaken = pc.fill_null(pc.not_equal(user, true_user), False)
    false: Bool = values_of(pc.or_(pc.is_null(true_user), is_mistaken)).astype(bool)
    return false & values_of(table["truth_known"]) if "truth_known" in table.column_names else false


def _extend(lane: SightingFacts, step: I64, false: Bool, gap: int) -> None:
    """Add stretches of later sightings to a lane; the first one may continue its last one."""
    order = np.argsort(step, kind="stable")
    step = step[order]
    false = false[order]
    cuts = (np.diff(step) > gap) | (false[1:] != false[:-1])
    first = step[np.append(True, cuts)].tolist()
    last = step[np.append(cuts, True)].tolist()
    is_false = false[np.append(True, cuts)].tolist()
    if lane["last"]:
        is_near = first[0] - lane["last"][-1] <= gap
        if is_near and is_false[0] == lane["false"][-1]:
            del lane["last"][-1], first[0], is_false[0]
    lane["first"] += first
    lane["last"] += last
    lane["false"] += is_false


Role = Literal["log", "algorithm", "metric", "layer"]


def run_facts(run: Run, walls: WallsHistory) -> RunFacts:
    """Return the facts of a run.

    Raises:
        ArtifactError: The run has no floor plan, or the plan can't be read.
    """
    manifest = run.manifest
    scenario = manifest["scenario"]
    verdicts = verdicts_of(run)
    facts = _first_facts(run_title(run), scenario, run.clock, home_facts(run.plan, walls.doors))
    facts.update(
        {
            "status": run.status,
            "notes": list(run.notes),
            "seed": manifest["seed"],
            "digest": run.digest,
            "bodies": bodies_of(scenario, manifest["entities"]),
            "tables": [_table_facts(run, name) for name in run.tables],
            "walls": walls.changes,
            "marks": marks_of(run),
            "verdict": verdict_line(run, verdicts),
            "verdicts": [
                VerdictFacts(name=v.name, outcome=v.outcome, says=v.says, step=v.step)
                for v in verdicts
            ],
            "story": story_of(run),
            "slows": slow_floors(scenario, manifest.get("interventions") or (), run.clock),
            "metrics": as_json(run.metrics),
        }
    )
    return facts


def _first_facts(title: str, scenario: dict[str, Any], clock: Clock, home: HomeFacts) -> RunFacts:
    """Return the facts of a run that has just started: nothing has happened yet."""
    return RunFacts(
        title=title,
        status="running",
        notes=[],
        start=(EPOCH + timedelta(microseconds=stamp_us(clock.start))).isoformat(),
        offsets=offsets_of(clock),
        step_us=clock.step_us,
        steps=clock.steps,
        first_step=0,
        end_step=clock.steps,
        seed=None,
        digest=None,
        version=__version__,
        home=home,
        bodies=[],
        tables=[],
        walls=[WallsChange(step=0, walls=0)],
        marks=[],
        verdict="",
        verdicts=[],
        story=[],
        slows=[],
        skies=skies_of(scenario, clock),
        starts_unlit=starts_unlit(scenario),
        event_kinds=sorted(EventKind),
        metrics={},
        scenario=scenario,
        walks_every_s=0.0,
    )


def offsets_of(clock: Clock) -> list[tuple[int, int]]:
    """Return the offsets from UTC over a run; see `RunFacts`."""
    start_us = stamp_us(clock.start)
    parts = even_parts(clock.start, 0, clock.steps * clock.step_us) if clock.zone else ()
    return [(begin_us, zero_us - start_us) for begin_us, _, zero_us in parts]


def as_json(result: Any) -> Any:
    """Return the result of a metric as JSON data: numbers that aren't finite become words.

    >>> as_json({"error": math.nan, "parts": [1.5, math.inf, "none"]})
    {'error': 'nan', 'parts': [1.5, 'inf', 'none']}
    """
    if isinstance(result, Mapping):
        return {str(key): as_json(value) for key, value in result.items()}
    if isinstance(result, list | tuple):
        return [as_json(value) for value in result]
    if isinstance(result, float) and not math.isfinite(result):
        return str(result)
    return result


def skies_of(scenario: Mapping[str, Any], clock: Clock) -> list[tuple[float, float, float, float]]:
    """Return when it gets light and dark on each day; see `RunFacts`.

    Without the home's latitude, the hours are the default ones of cameras on each day.
    """
    daylight = scenario["simulation"].get("daylight")
    if daylight is None:
        (dark_until, _), (light_from, _), (light_until, _), (dark_from, _) = DARK_NIGHT.points
        return [(dark_until, light_from, light_until, dark_from)]
    settings = Daylight(**daylight)
    sun = Sun(settings.latitude, settings.noon, clock.zone)
    first = clock.start.toordinal()
    last = clock.time(clock.steps - 1).toordinal()
    return [_sky(*sun.day(ordinal)) for ordinal in range(first, last + 1)]


def _sky(rise: datetime, fall: datetime) -> tuple[float, float, float, float]:
    """Return the hours of a day around which the sun rises and sets."""
    midnight = datetime.combine(rise.date(), time())
    hour = timedelta(hours=1)
    rise_h = (written(rise) - midnight) / hour
    fall_h = (written(fall) - midnight) / hour
    twilight_h = TWILIGHT / hour
    return rise_h - twilight_h, rise_h + twilight_h, fall_h - twilight_h, fall_h + twilight_h


def run_title(run: Run) -> str:
    """Return the title of a run: the name of its directory, else of its scenario."""
    if run.directory is not None:
        return Path(run.directory).resolve().name
    return str(run.manifest["scenario"].get("name") or "run")


def bodies_of(scenario: Mapping[str, Any], entities: Mapping[str, Any]) -> list[BodyFacts]:
    """Return the facts of users, then of robots."""
    bodies = []
    for bucket, robot in (("users", False), ("robots", True)):
        for number, name in enumerate(entities.get(bucket, ())):
            settings = scenario.get(bucket, {}).get(name, {})
            cameras = {"camera": settings.get("camera"), **(settings.get("cameras") or {})}
            color = settings.get("color")
            bodies.append(
                BodyFacts(
                    name=name,
                    robot=robot,
                    color=color if _is_color(color) else body_color(number, robot=robot),
                    radius=float(settings.get("radius", 0.15 if robot else 0.2)),
                    cameras=[_camera(key, value) for key, value in cameras.items() if value],
                    behaviors=[b.get("type", "") for b in settings.get("behaviors", ())],
                    keys={},
                )
            )
    return bodies


def _is_color(value: object) -> bool:
    return isinstance(value, str) and value.startswith("#") and len(value) == 7


def _camera(name: str, camera: Mapping[str, Any]) -> CameraFacts:
    near, far = camera.get("range", DEFAULT_RANGE_M)
    forward, left = camera.get("offset", (0.0, 0.0))
    pan = camera.get("pan") or {}
    dwell = parse_duration(pan.get("dwell", "5 s"))
    return CameraFacts(
        name=name,
        near=near,
        far=far,
        angle=math.radians(camera.get("angle_deg", DEFAULT_ANGLE_DEG)),
        forward=forward,
        left=left,
        heading=math.radians(camera.get("heading_deg", 0.0)),
        pan=[math.radians(degrees) for degrees in pan.get("headings_deg", ())],
        pan_us=round(dwell.total_seconds() * 1e6),
    )


def _table_facts(run: Run, name: str) -> TableFacts:
    description = run.manifest["tables"].get(name)
    if description is None:  # the manifest of an unfinished run doesn't list its tables
        description = _description_of(run, name)
    path = None if run.directory is None else path_in(run.directory, f"{name}.parquet")
    return TableFacts(
        name=name,
        rows=int(description["rows"]),
        bytes=path.stat().st_size if path is not None and path.exists() else 0,
        role=_role(run.manifest["scenario"], name),
        columns=[
            ColumnFacts(
                name=column["name"],
                kind=column.get("kind", ""),
                unit=column.get("unit", ""),
                description=column.get("description", ""),
            )
            for column in description["columns"]
        ],
    )


def _description_of(run: Run, name: str) -> dict[str, Any]:
    from fleet2d.artifacts.arrow import spec_of

    try:
        table = run.tables[name]
        columns = spec_of(table.schema).columns
    except ArtifactError:
        return {"rows": 0, "columns": []}
    facts = [{"name": c.name, "kind": c.kind, "unit": c.unit} for c in columns]
    return {"rows": table.num_rows, "columns": facts}


def _role(scenario: Mapping[str, Any], name: str) -> Role:
    if name.startswith(LAYER_PREFIX):
        return "layer"
    if name in scenario.get("algorithms", {}):
        return "algorithm"
    return "metric" if name in scenario.get("metrics", {}) else "log"


def live_facts(simulation: Simulation) -> RunFacts:
    """Return the facts of a running simulation, which has no tables yet."""
    scenario = plain(simulation.scenario.resolved())
    clock = simulation.clock
    plan = simulation.home.plan
    objects = simulation.scenario.objects.items()
    doors = [door_facts(name, door, plan) for name, door in objects if isinstance(door, Door)]
    bodies = bodies_of(scenario, scenario)
    for body in bodies:
        for behavior in simulation.actors[body["name"]].behaviors:
            keys = behavior.model_dump(mode="json")
            body["keys"].setdefault(behavior.type_name, keys)
    title = simulation.scenario.name or "live run"
    facts = _first_facts(title, scenario, clock, home_facts(plan, doors))
    facts["seed"] = simulation.seed
    facts["bodies"] = bodies
    facts["slows"] = slow_floors(scenario, interventions_of(simulation), clock)
    return facts
