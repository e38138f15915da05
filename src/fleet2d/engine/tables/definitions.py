"""The tables of a run and their columns."""

from collections.abc import Sequence
from dataclasses import replace

from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.engine.basis import Basis
from fleet2d.engine.tables.shared_columns import HEADING, STEP, TIME, X, Y, away_column
from fleet2d.engine.tables.trajectories import trajectory_table
from fleet2d.engine.watchers.cameras import Cameras
from fleet2d.engine.watchers.sensors import Sensors
from fleet2d.floorplan.objects import POSTURES
from fleet2d.runs.key_kinds import KEY_KINDS


def table_specs(
    basis: Basis, cameras: Sequence[Cameras], sensors: Sensors, *, activities: bool
) -> list[TableSpec]:
    """Return the tables that a run stores.

    Args:
        basis: The basis of the run.
        cameras: The cameras of robots.
        sensors: The sensors of the home.
        activities: Whether robots perceive activities.
    """
    scenario, settings = basis.scenario, basis.scenario.artifacts
    users, robots = tuple(scenario.users), tuple(scenario.robots)
    rooms = tuple(room.name for room in basis.home.rooms)
    entity = Column("entity", "category", categories=(*users, *robots))
    room = Column("room", "category", nullable=True, categories=rooms)
    specs = []
    if settings.trajectories != "off":
        specs.append(trajectory_table(entity, room))
    if settings.key_frames:
        kind = Column("kind", "category", categories=KEY_KINDS)
        columns = (
            STEP,
            TIME,
            entity,
            kind,
            X,
            Y,
            HEADING,
            away_column("x and y are where it left"),
        )
        specs.append(TableSpec("key_frames", columns))
    if settings.observations and users and robots:
        specs.append(_observation_table(users, robots, room, camera_names(cameras), activities))
    if settings.events:
        event, detail = Column("event", "category"), Column("detail", "string")
        user = Column("user", "category", nullable=True, categories=users)
        user_columns = (user,) if users else ()
        entities = entity
        if basis.may_change:
            text = "what did it, or what it happened to; none: the home itself"
            names = (*users, *robots, *scenario.objects)
            entities = Column(
                "entity", "category", categories=names, nullable=True, description=text
            )
        specs.append(TableSpec("events", (STEP, TIME, entities, event, *user_columns, detail)))
    if sensors.names:
        specs.append(_sensor_table(sensors))
    return specs


def camera_names(cameras: Sequence[Cameras]) -> tuple[str, ...]:
    """Return the names of all cameras if the table of observations has to name them.

    It does if a robot has several cameras, or cameras that err.
    """
    if not any(group.errs or len(group.names) > 1 for group in cameras):
        return ()
    return tuple(dict.fromkeys(name for group in cameras for name in group.names))


def _observation_table(
    users: Sequence[str],
    robots: Sequence[str],
    room: Column,
    cameras: Sequence[str],
    activities: bool,
) -> TableSpec:
    """Return the table of what was perceived, with the truth if that can differ."""
    robot = Column("robot", "category", categories=tuple(robots))
    user = Column("user", "category", nullable=bool(cameras), categories=tuple(users))
    columns = [STEP, TIME, robot, user, X, Y, room]
    if cameras:
        posture = Column("posture", "category", categories=POSTURES)
        true = {
            column.name: replace(column, name=f"true_{column.name}", nullable=True)
            for column in (user, X, Y, HEADING, posture)
        }
        camera = Column("camera", "category", categories=tuple(cameras))
        columns += [HEADING, posture, camera, *true.values()]
    if activities:
        text = "what the user does, if a behavior says so"
        for name in ("activity", "true_activity"):
            columns.append(Column(name, "category", nullable=True, description=text))
    return TableSpec("observations", tuple(columns))


def _sensor_table(sensors: Sensors) -> TableSpec:
    """Return the table of the readings of sensors, in the layout of the CASAS smart homes."""
    sensor = Column("sensor", "category", categories=tuple(sensors.names))
    room, state = Column("room", "category"), Column("state", "category")
    activity = Column("activity", "string", description="what the person does, if known")
    return TableSpec("sensors", (STEP, TIME, room, sensor, state, activity))
