"""Sightings of one camera, made for tests of errors of perception."""

from datetime import datetime
from typing import cast

import numpy as np

from fleet2d import CameraSightings, Home
from fleet2d.sight.perception_error import ErrorStream


def sightings(
    x,
    y,
    camera=(0.0, 0.0),
    seed=1,
    name="camera: errors.e",
    **columns,
):
    """Return sightings of ana at places [m], one a step, that are true but for some columns."""
    count = len(np.asarray(x))
    zeros = {
        "step": np.arange(count),
        "true_user": np.zeros(count, np.int64),
        "user": np.zeros(count, np.int64),
        "posture": np.zeros(count, np.int64),
        "noticed": np.ones(count, np.bool_),
        "heading": np.zeros(count),
    }
    values = {**zeros, "x": x, "y": y, **columns}
    values = {
        key: np.array(value, np.asarray(zeros.get(key, 0.0)).dtype) for key, value in values.items()
    }
    true = {f"true_{key}": values[key].copy() for key in ("x", "y", "heading", "posture")}
    eye = {f"camera_{key}": np.full(count, value) for key, value in zip("xy", camera, strict=True)}
    return CameraSightings(
        camera="camera",
        users=("ana", "ben", "cleo"),
        home=cast(Home, None),
        start=datetime(2026, 1, 5, 23),
        step_s=1.0,
        camera_heading=np.zeros(count),
        _stream=ErrorStream(seed, "robots.r", name),
        **values,
        **true,
        **eye,
    )
