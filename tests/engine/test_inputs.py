"""The files that a run depends on: what components read, and the modules of a user's own."""

from pathlib import Path
from typing import Any

import numpy as np
from tests.scenes import flat_path, scenario

import fleet2d
from fleet2d.engine.inputs import input_files

NET = """
import numpy as np
from fleet2d.algorithms.presence.model import Model
from fleet2d.units import InputPath

class Net(Model):
    '''Learned elsewhere.'''
    weights: InputPath

    def observe(self, bins):
        home = np.zeros((len(bins.day), self.users + 1, self.rooms))
        home[..., 0] = np.load(self.weights)
        return home, np.zeros(home.shape[:2])
"""


def content(folder: Path, **sections: Any) -> dict[str, Any]:
    (folder / "net.py").write_text(NET)
    np.save(folder / "weights.npy", np.ones(1))
    model = {"type": f"{folder.as_posix()}/net:Net", "weights": str(folder / "weights.npy")}
    return scenario("10 min", algorithms={"rtp": {"type": "rtp", "model": model}}, **sections)


def test_a_model_within_an_algorithm_is_noted_with_its_weights(tmp_path: Path) -> None:
    paths = input_files(fleet2d.load_scenario(content(tmp_path)))
    assert {flat_path(), tmp_path / "net.py", tmp_path / "weights.npy"} == set(paths)


def test_other_weights_are_said_to_have_changed(tmp_path: Path) -> None:
    fleet2d.run(content(tmp_path), out=tmp_path / "run")
    assert [] == fleet2d.reproduce(tmp_path / "run").causes
    np.save(tmp_path / "weights.npy", np.full(1, 1.0000001))
    again = fleet2d.reproduce(tmp_path / "run")
    assert [f"{tmp_path / 'weights.npy'} has changed since"] == again.causes


DRIVE = """
from fleet2d import Drive, Moment

class Glides(Drive):
    '''Never turns.'''
    def moments(self, route):
        length = sum(leg.length for leg in route.legs)
        return [Moment(length / route.speed, length, route.heading)]
"""


def test_a_drive_and_errors_of_a_camera_are_noted(tmp_path: Path) -> None:
    """Components are found wherever they stand, so that a study notices that one was edited."""
    (tmp_path / "mine.py").write_text(DRIVE)
    (tmp_path / "blurry.py").write_text(
        "from fleet2d import PerceptionError\n\nclass Blurry(PerceptionError):\n"
        "    '''Nothing changes.'''\n    def distort(self, sightings):\n        return sightings\n"
    )
    robot = {
        "drive": {"type": f"{tmp_path.as_posix()}/mine:Glides"},
        "camera": {
            "range": [0, 4],
            "angle_deg": 90,
            "perception": {"errors": {"b": {"type": f"{tmp_path.as_posix()}/blurry:Blurry"}}},
        },
    }
    files = input_files(fleet2d.load_scenario(scenario("10 min", robots={"astro": robot})))
    assert {tmp_path / "mine.py", tmp_path / "blurry.py"} <= set(files)
