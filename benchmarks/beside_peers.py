"""Fleet2D beside simulators that people would pick instead: what each installs, and an hour in it.

    python benchmarks/beside_peers.py            # needs the network; some minutes

Each has an environment of its own, with the newest version of the package index; of Fleet2D it is
this clone. The hour is that of a person and a robot who walk at random in steps of 1 s: in Fleet2D
in the bundled home, in IR-SIM in a room of 10 by 8 m, in which the robot looks for the person in
every step; in Mesa on a grid of 50 by 40 cells, as it has neither walls nor sight. pyrobosim sleeps
between the steps of a path, so that its processor time would tell nothing.
"""

import json
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
STEPS = 3600
REPEATS = 3
FLEET2D = """
import fleet2d
scenario = {
    "simulation": {"duration": "1 h", "seed": 4},
    "floorplan": "bundled",
    "users": {"ana": "meander"},
    "robots": {"astro": {"type": "meander", "camera": {"range": [0, 4.5], "angle_deg": 108}}},
}
def hour():
    fleet2d.run(scenario)
"""
IRSIM = """
import irsim, json, tempfile, pathlib
robots = [
    {"kinematics": {"name": "diff"}, "shape": {"name": "circle", "radius": 0.2},
     "state": [x, 4, 0], "goal": [9 - x, 5, 0], "behavior": {"name": "dash", "wander": True},
     "vel_max": [1, 1], "fov": 1.88, "fov_radius": 4.5}
    for x in (3, 7)
]
walls = {"shape": {"name": "linestring", "vertices": [[0, 0], [10, 0], [10, 8], [0, 8], [0, 0]]}}
world = {"width": 10, "height": 8, "step_time": 1, "collision_mode": "unobstructed"}
path = pathlib.Path(tempfile.mkdtemp(), "world.yaml")
path.write_text(json.dumps({"world": world, "robot": robots, "obstacle": [walls]}))
env = irsim.make(str(path), headless=True, log_level="ERROR")
def hour():
    for _ in range(3600):
        env.step()
        env.robot_list[0].fov_detect_object(env.robot_list[1])
"""
MESA = """
import mesa
from mesa.space import MultiGrid
class Walker(mesa.Agent):
    def step(self):
        near = self.model.grid.get_neighborhood(self.pos, moore=True)
        self.model.grid.move_agent(self, self.random.choice(near))
class Home(mesa.Model):
    def __init__(self):
        super().__init__(seed=4)
        self.grid = MultiGrid(50, 40, torus=False)
        for x in (15, 35):
            self.grid.place_agent(Walker(self), (x, 20))
    def step(self):
        self.agents.do("step")
home = Home()
def hour():
    for _ in range(3600):
        home.step()
"""
CASES = {
    "fleet2d": (str(ROOT), FLEET2D),
    "ir-sim": ("ir-sim", IRSIM),
    "mesa": ("mesa", MESA),
    "pyrobosim": ("pyrobosim", None),
}
TIMED = """
import time
hour()
best = 1e9
for _ in range({repeats}):
    began = time.process_time()
    hour()
    best = min(best, time.process_time() - began)
print("RESULT", best)
"""
INSTALLED = """
import importlib.metadata as m, json, pathlib, sysconfig
names = {d.metadata["Name"] for d in m.distributions()} - {"pip"}
folder = pathlib.Path(sysconfig.get_path("purelib"))
size = sum(f.stat().st_size for f in folder.rglob("*") if f.is_file() and "pip" not in f.parts)
print(json.dumps([len(names), size]))
"""


def main() -> None:
    """Measure all, or those that the command line names, and print a table."""
    print("| simulator | version | packages | MB | s an hour |")
    for name in sys.argv[1:] or CASES:
        requirement, code = CASES[name]
        with tempfile.TemporaryDirectory() as folder:
            venv.create(folder, with_pip=True)
            python = Path(folder, "bin", "python")
            run(python, "-m", "pip", "install", "--quiet", "--no-compile", requirement)
            packages, size = json.loads(run(python, "-c", INSTALLED).splitlines()[-1])
            told = f"import importlib.metadata as m; print(m.version({name!r}))"
            cells = [name, run(python, "-c", told).strip(), packages, f"{size / 1e6:.0f}"]
            cells.append(f"{timed(python, code):.3f}" if code else "-")
        print(f"| {' | '.join(map(str, cells))} |", flush=True)


def run(python: Path, *arguments: str) -> str:
    """Run a Python elsewhere than in the clone, and return what it prints."""
    command = [str(python), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tempfile.gettempdir())
    if done.returncode:
        raise SystemExit(f"{' '.join(command[:4])} failed:\n{done.stderr[-2000:]}")
    return done.stdout


def timed(python: Path, code: str) -> float:
    """Return the best processor time of an hour [s], once all is loaded."""
    printed = run(python, "-c", code + TIMED.format(repeats=REPEATS))
    return float(printed.rpartition("RESULT")[2])


if __name__ == "__main__":
    main()
