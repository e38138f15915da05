"""Pictures of a life: the home, everybody in it, and how a policy rates the rooms."""

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fleet2d.errors import InputError
from fleet2d.kernels import F32
from fleet2d.learning.gym.env import RobotEnv
from fleet2d.palette import ACCENT_COLOR, body_color
from fleet2d.viewing.pictures.floorplan import drawing_style, figure_size, floorplan_axes


def life_figure(env: RobotEnv, scores: F32 | None = None) -> Figure:
    """Return a picture of the present moment of a life.

    Args:
        env: The environment.
        scores: A policy's scores of the actions, float32 (rooms + 1,), which are shown as
            probabilities (softmax) of the possible ones; None: none are shown.

    Raises:
        InputError: There is no life, or the scores aren't those of its actions.
    """
    if scores is not None and np.shape(scores) != (actions := env.action_masks()).shape:
        raise InputError(
            f"scores are of {len(actions)} actions, the rooms and to rest: got {np.shape(scores)}"
        )
    simulation = env.present.simulation
    plan = simulation.home.plan
    figure = Figure(figsize=figure_size(plan))
    with drawing_style():
        axes = figure.add_axes((0, 0, 1, 1))
        floorplan_axes(plan, axes, names=scores is None)
    for number, (name, actor) in enumerate(simulation.actors.items()):
        state = simulation.state[name]
        if not state["away"]:
            color = body_color(number, robot=name in simulation.scenario.robots)
            axes.scatter(state["x"], state["y"], s=80, color=color, zorder=9)
            spot = (state["x"] + actor.entity.radius, state["y"])
            axes.annotate(name, spot, color=color, zorder=9)
    if scores is not None:
        chances = np.where(env.action_masks(), np.exp(scores - scores.max()), 0.0)
        for room, chance in zip(plan.rooms, chances / chances.sum(), strict=False):
            x, y = room.anchor_xy
            size = 20 + 3000 * float(chance)
            axes.scatter(x, y, s=size, color=ACCENT_COLOR, alpha=0.35, linewidths=0, zorder=7)
            axes.annotate(f"{room.name}\n{chance:.0%}", (x, y), ha="center", zorder=8)
    return figure


def pixels_of(figure: Figure) -> Any:
    """Return a figure as an array, uint8 (height, width, 3)."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
