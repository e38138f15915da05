"""The check of a user's own errors of perception finds what the engine can't rely on."""

import itertools

import numpy as np
import pytest

from fleet2d import CameraSightings, PerceptionError
from fleet2d.sight.miscalibration import Miscalibration
from fleet2d.sight.outliers import Outliers
from fleet2d.testing import check_perception_error

COUNT = itertools.count()


class Counting(PerceptionError):
    """Shifts people by what no seed determines."""

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        return sightings.moved(offset=0.001 * next(COUNT))


class Joint(PerceptionError):
    """Shifts all people of a call by the same, so that it matters how many looks a call has."""

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        return sightings.moved(offset=0.01 * len(sightings))


class Undefined(PerceptionError):
    """Returns what can't be stored."""

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        return sightings.replace(x=np.nan)


def test_the_built_in_errors_pass() -> None:
    check_perception_error(Outliers, share="10 %", lasts="5 s")
    check_perception_error(Miscalibration, yaw_deg=3)


@pytest.mark.parametrize(
    ("cls", "message"),
    [
        (Counting, "Counting: two runs with one seed differ"),
        (Joint, "Joint: a run in spans of 7 steps differs: treat each sighting by itself"),
        (Undefined, "errors.checked failed at step .*: x is nan"),
    ],
)
def test_each_problem_is_named(cls: type[PerceptionError], message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        check_perception_error(cls)
