"""Plans as numbers and texts, for the records of a run."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from fleet2d.entities.motion import RandomWalk
from fleet2d.entities.plan import Note, Plan
from fleet2d.errors import ComponentError
from fleet2d.floorplan.objects import POSTURES
from fleet2d.kernels import I64
from fleet2d.kernels.motion import Legs, WalkRule
from fleet2d.kernels.space import SUB
from fleet2d.problems import problem, refusal

if TYPE_CHECKING:
    from fleet2d.entities.body import Body


def _check_note(note: list[Any]) -> list[Any]:
    time_us, event, detail = note
    if type(time_us) is not int or not isinstance(event, str) or not isinstance(detail, str):
        raise ValueError("expected the time of a note [us], its event and a detail")
    return note


def _check_posture(change: list[int]) -> list[int]:
    _, code = change
    if not 0 <= code < len(POSTURES):
        raise ValueError(f"{code} is the number of no posture")
    return change


_Integer = Annotated[int, Field(gt=-(2**61), lt=2**61)]
_FIVE = Field(min_length=5, max_length=5)


def data_of(plan: Plan) -> dict[str, Any]:
    """Return a plan as numbers and texts, from which `plan_of` makes the same plan again."""
    motion = plan.finish()
    walk: list[Any] | None = list(motion.rule) if isinstance(motion, RandomWalk) else None
    return {
        "rows": plan.legs.rows().tolist(),
        "walk": None if walk is None else [int(number) for number in walk],
        "notes": [list(note) for note in plan.notes],
        "interrupts": sorted(plan.interrupts),
        "asks_us": plan.asks_us,
        "endless": plan.endless,
        "postures": [list(change) for change in plan.postures],
    }


def check_data(data: dict[str, Any]) -> dict[str, Any]:
    """Return `data` if `plan_of` can read it: an edited manifest may hold anything.

    Raises:
        PydanticCustomError: It describes no plan.
    """
    try:
        _PlanForm.model_validate(data)
    except ValidationError as error:
        raise problem(str(refusal("", error))) from None
    return data


class _PlanForm(BaseModel):
    """The form of what `data_of` returns."""

    model_config = ConfigDict(strict=True, extra="forbid", defer_build=True)

    rows: list[Annotated[list[_Integer], _FIVE]]
    walk: Annotated[list[Annotated[int, Field(ge=0, lt=2**64)]], _FIVE] | None
    notes: list[Annotated[list[Any], AfterValidator(_check_note)]]
    interrupts: list[str]
    asks_us: _Integer | None
    endless: bool
    postures: list[Annotated[list[_Integer], AfterValidator(_check_posture)]]


def plan_of(body: "Body", step: int, data: Mapping[str, Any]) -> Plan:
    """Return the plan that `data` describes, for a body to follow from a step on.

    Raises:
        ComponentError: It leads out of the floor plan, goes back in time, or waits for what can't
            happen.
    """
    plan = Plan(body, step)
    if data["walk"] is not None:
        key, *numbers = data["walk"]
        return plan.meander(WalkRule(np.uint64(key), *numbers))
    rows = np.array(data["rows"], np.int64).reshape(-1, 5)
    _check_rows(body, plan.time_us, rows)
    plan.legs = Legs()
    try:
        plan.legs.add(rows)
    except ValueError as error:
        raise ComponentError(f"{body.path}: the plan of an intervention: {error}") from None
    plan.time_us, plan.x, plan.y, plan.heading, plan.away = data["rows"][-1]
    plan.notes = [Note(*note) for note in data["notes"]]
    plan.interrupt_on(*data["interrupts"])
    plan.asks_us, plan.endless = data["asks_us"], data["endless"]
    plan.postures = [(time, code) for time, code in data["postures"]]
    return plan


def _check_rows(body: "Body", begin_us: int, rows: I64) -> None:
    """Refuse breakpoints that a body can't follow from a moment on."""
    size = body.home.plan.room_of_place.shape
    x, y = rows[:, 1] // SUB, rows[:, 2] // SUB
    inside = (x >= 0) & (x < size[1]) & (y >= 0) & (y < size[0])
    times = rows[:, 0]
    if not len(rows) or times[0] > begin_us or (np.diff(times) < 0).any() or not inside.all():
        raise ComponentError(
            f"{body.path}: the plan of an intervention can't be followed: its breakpoints should be"
            f" in the home and in order of time, the first at {begin_us} us or before"
        )
