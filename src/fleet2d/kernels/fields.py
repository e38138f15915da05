"""Fields over the cells of a grid: distances to walls and to places."""

from fleet2d._core import (
    MOST_COST,
    cost_distance,
    descend,
    squared_distance,
    step_cost,
    walking_distance,
)

__all__ = [
    "MOST_COST",
    "cost_distance",
    "descend",
    "squared_distance",
    "step_cost",
    "walking_distance",
]
