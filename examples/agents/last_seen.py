"""Write a small policy as an ONNX file, and let a robot follow it as its behavior.

    pip install "fleet2d[gym,onnx]" onnx
    python examples/agents/last_seen.py [FILE]

The policy waits where it saw somebody last, else it looks elsewhere: a room's score is a weighted
sum of columns of the observation. It isn't learned, but what is learned is used in the same way.
"""

import sys
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

import fleet2d
from fleet2d.entities.robots.policy import COLUMNS

ROOMS = 16
WEIGHTS = {"seen_30min": 1.0, "seen_6h": 0.5, "habit_now": 0.5, "visited_6h": -0.2, "way": -0.05}
REST = -1.0  # the score of staying where it is


def write_policy(path: Path) -> None:
    """Write scores = observation @ weights, and that of the rest after them."""
    weights = np.array([[WEIGHTS.get(name, 0.0)] for name in COLUMNS], np.float32)
    constants = {
        "weights": weights,
        "rest": np.array([[REST]], np.float32),
        "shape": np.array([1, ROOMS], np.int64),
    }
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["observation", "weights"], ["column"]),
            helper.make_node("Reshape", ["column", "shape"], ["rooms"]),
            helper.make_node("Concat", ["rooms", "rest"], ["scores"], axis=1),
        ],
        "last seen",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, [1, ROOMS, len(COLUMNS)])],
        [helper.make_tensor_value_info("scores", TensorProto.FLOAT, [1, ROOMS + 1])],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    opset = helper.make_opsetid("", 17)
    onnx.save(helper.make_model(graph, opset_imports=[opset], ir_version=9), path)


def main() -> None:
    """Write the policy, and compare a week with it to one with the behavior `hangout`."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "last_seen.onnx").resolve()
    write_policy(path)
    behaviors = {
        "hangout": {"type": "hangout"},
        path.name: {"type": "policy", "task": "hangout", "file": str(path)},
    }
    for name, behavior in behaviors.items():
        run = fleet2d.run(
            "bundled:paper",
            "simulation.duration=7 d",
            seed=4,
            users={"ana": {"persona": "retired"}},
            robots={"astro": {"behaviors": [behavior]}},
            algorithms={},
            metrics={"sightings": {}},
        )
        moves = run.pandas("events").event.isin(["relocates", "explores"]).sum()
        (metric,) = (value for key, value in run.metrics["sightings"].items() if "ana" in key)
        print(f"{name:<16} {metric}; {moves} relocations")


if __name__ == "__main__":
    main()
