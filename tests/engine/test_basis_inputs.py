"""The files that a run depends on: what components read, and the modules of a user's own."""

import json

import numpy as np
import pytest
from tests.scenes import flat_path, process, scenario

import fleet2d
from fleet2d.engine.basis import input_files

NET = """
import numpy as np
from fleet2d.algorithms.presence.model import Model
from fleet2d.configuration.units import InputPath

class Net(Model):
    '''Learned elsewhere.'''
    weights: InputPath

    def observe(self, bins):
        home = np.zeros((len(bins.day), self.users + 1, self.rooms))
        home[..., 0] = np.load(self.weights)
        return home, np.zeros(home.shape[:2])
"""


def content(folder, **sections):
    (folder / "net.py").write_text(NET)
    np.save(folder / "weights.npy", np.ones(1))
    model = {"type": f"{folder.as_posix()}/net:Net", "weights": str(folder / "weights.npy")}
    return scenario(
        "10 min", algorithms={"rtp": {"type": "real_time_presence", "model": model}}, **sections
    )


def test_a_model_within_an_algorithm_is_noted_with_its_weights(tmp_path):
    paths = input_files(fleet2d.load_scenario(content(tmp_path)))
    assert {flat_path(), tmp_path / "net.py", tmp_path / "weights.npy"} == set(paths)


WAITS = """
from fleet2d import Behavior
{imports}

class Waits(Behavior):
    def decide(self, now):
        return now.plan().interrupt_on({crowded}).stay()
"""
CROWDED = """
import numpy as np
from fleet2d import Interrupt

class Crowded(Interrupt):
    def holds(self, span):
        return np.zeros(span.poses.x.shape[1], bool)
"""


@pytest.mark.parametrize("is_imported", [True, False])
def test_an_interrupt_that_only_a_plan_names_is_noted(tmp_path, is_imported):
    """It may be imported beside the behavior, or named in a text: then it is known at the end."""
    crowded = tmp_path / "crowd.py"
    crowded.write_text(CROWDED)
    name = "Crowded" if is_imported else repr(f"{tmp_path.as_posix()}/crowd:Crowded")
    imports = "from crowd import Crowded" if is_imported else ""
    (tmp_path / "mine.py").write_text(WAITS.format(imports=imports, crowded=name))
    waits = {"type": f"{tmp_path.as_posix()}/mine:Waits"}
    content = scenario("10 min", robots={"astro": {"behaviors": [waits]}})
    assert is_imported == (crowded in input_files(fleet2d.load_scenario(content)))
    fleet2d.run(content, out=tmp_path / "run")
    assert [] == fleet2d.reproduce(tmp_path / "run").causes
    crowded.write_text(f"{CROWDED}\n# edited")
    assert [f"{crowded} has changed since"] == fleet2d.reproduce(tmp_path / "run").causes


def test_a_component_of_a_file_beside_is_named_by_its_folder(tmp_path):
    """Its manifest said "waits:Waits", which only a process in that folder could import."""
    (tmp_path / "mine.py").write_text("from waits import Waits as Mine")
    (tmp_path / "waits.py").write_text(WAITS.format(imports="", crowded="'home_empty'"))
    waits = {"type": f"{tmp_path.as_posix()}/mine:Mine"}
    fleet2d.run(scenario("1 min", robots={"astro": {"behaviors": [waits]}}), out=tmp_path / "run")
    assert fleet2d.reproduce(tmp_path / "run", trust=True).same
    content = json.loads((tmp_path / "run" / "manifest.json").read_text())["scenario"]
    (behavior,) = content["robots"]["astro"]["behaviors"]
    assert f"{tmp_path.as_posix()}/waits:Waits" == behavior["type"]


@pytest.mark.slow
def test_a_class_without_a_file_is_no_input():
    """One typed at a prompt; its run ended in a traceback."""
    code = (
        "import fleet2d\n"
        "class Idle(fleet2d.Algorithm):\n"
        "    def update(self, history, state): pass\n"
        "run = fleet2d.run('algorithms.idle.type=__main__:Idle', duration='10 min', seed=4)\n"
        "print(run.manifest['inputs'])"
    )
    done = process("-c", f"exec(compile({code!r}, '<stdin>', 'exec'))")
    assert (0, "[]\n") == (done.returncode, done.stdout), done.stderr


DRIVE = """
from fleet2d import Drive, Moment

class Glides(Drive):
    '''Never turns.'''
    def moments(self, route):
        length = sum(leg.length for leg in route.legs)
        return [Moment(length / route.speed, length, route.heading)]
"""


def test_a_drive_and_errors_of_a_camera_are_noted(tmp_path):
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
