"""Plans as numbers and texts, for the records of a run."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.entities.motion import RandomWalk
from fleet2d.entities.plan import Note, Plan
from fleet2d.kernels.motion import Legs, WalkRule

if TYPE_CHECKING:
    from fleet2d.entities.body import Body


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


def plan_of(body: "Body", step: int, data: Mapping[str, Any]) -> Plan:
    """Return the plan that `data` describes, for a body to follow from a step on."""
    plan = Plan(body, step)
    if data["walk"] is not None:
        key, *numbers = data["walk"]
        return plan.meander(WalkRule(np.uint64(key), *numbers))
    plan.legs = Legs()
    plan.legs.add(np.array(data["rows"], np.int64).reshape(-1, 5))
    plan.time_us, plan.x, plan.y, plan.heading, plan.away = data["rows"][-1]
    plan.notes = [Note(*note) for note in data["notes"]]
    plan.interrupts, plan.asks_us = frozenset(data["interrupts"]), data["asks_us"]
    plan.endless = data["endless"]
    plan.postures = [(time, code) for time, code in data["postures"]]
    return plan
