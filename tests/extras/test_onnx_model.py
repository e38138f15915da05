"""Networks in ONNX files: the shipped one gives the same beliefs, and wrong files are named."""

import numpy as np
import pytest

import fleet2d
from fleet2d.algorithms.presence.learned import TRUSTS, shipped_weights
from fleet2d.errors import Fleet2DError

onnx = pytest.importorskip("onnx", reason="onnx isn't installed")
pytest.importorskip("onnxruntime", reason="onnxruntime isn't installed")


def graph_of(nodes, weights, inputs):
    """A model whose last node gives the output."""
    helper, numpy_helper = onnx.helper, onnx.numpy_helper
    shapes = {"features": ["bins", "places", 25], "places": ["places", 12], "other": ["n"]}
    model = helper.make_model(
        helper.make_graph(
            nodes,
            "model",
            [helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, shapes[n]) for n in inputs],
            [helper.make_tensor_value_info("output", onnx.TensorProto.FLOAT, None)],
            [numpy_helper.from_array(np.asarray(v), name=n) for n, v in weights.items()],
        ),
        opset_imports=[helper.make_opsetid("", 17)],
    )
    model.ir_version = 8
    return bytes(model.SerializeToString())


def shipped():
    """The shipped network as ONNX, without its trust, which depends on the gap."""
    weights = shipped_weights()
    node = onnx.helper.make_node
    arrays = {
        "w_places": weights.places,
        "start": weights.start,
        **{name: part for name, part in weights.network._asdict().items() if name != "score"},
        "score": weights.network.score[:, None],
    }
    arrays = {name: part.astype(np.float32) for name, part in arrays.items()}
    indices = {"last": np.array([24]), "two": np.array([2])}
    nodes = [
        node("MatMul", ["features", "first"], ["a"]),
        node("MatMul", ["places", "w_places"], ["b"]),
        node("Add", ["b", "start"], ["c"]),
        node("Add", ["a", "c"], ["d"]),
        node("Relu", ["d"], ["inner"]),
        node("ReduceMean", ["inner"], ["mean"], axes=[1], keepdims=1),
        node("MatMul", ["mean", "context"], ["e"]),
        node("Add", ["e", "bias"], ["f"]),
        node("MatMul", ["inner", "second"], ["g"]),
        node("Add", ["g", "f"], ["h"]),
        node("Relu", ["h"], ["outer"]),
        node("MatMul", ["outer", "score"], ["i"]),
        node("Gather", ["features", "last"], ["prior"], axis=2),
        node("Add", ["i", "prior"], ["j"]),
        node("Squeeze", ["j", "two"], ["output"]),
    ]
    return graph_of(nodes, {**arrays, **indices}, ("features", "places"))


def beliefs(model):
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=8 h",
        seed=3,
        algorithms={"rtp": {"type": "real_time_presence", "model": model}},
    )
    return np.array(run.arrow("rtp")["share"].to_pylist())


def test_the_shipped_network_as_onnx_has_the_same_beliefs(tmp_path):
    (tmp_path / "own.onnx").write_bytes(shipped())

    trusting = shipped_weights()._replace(trust=np.ones(TRUSTS))
    trusting.save(tmp_path / "own.npz")

    own = beliefs({"type": "onnx", "file": str(tmp_path / "own.onnx")})

    learned = beliefs({"type": "learned", "weights": str(tmp_path / "own.npz")})
    assert np.abs(own - learned).max() < 1e-4


def test_other_files_and_other_inputs_are_refused(tmp_path):
    foreign = tmp_path / "foreign.onnx"
    foreign.write_bytes(b"no model")
    with pytest.raises(Fleet2DError, match="is no ONNX model"):
        beliefs({"type": "onnx", "file": str(foreign)})
    other = tmp_path / "other.onnx"
    node = onnx.helper.make_node("Relu", ["other"], ["output"])
    other.write_bytes(graph_of([node], {}, ("other",)))
    with pytest.raises(Fleet2DError, match="has the inputs other, expected features"):
        beliefs({"type": "onnx", "file": str(other)})


def test_an_output_of_another_shape_is_named(tmp_path):
    file = tmp_path / "wide.onnx"
    nodes = [
        onnx.helper.make_node("Relu", ["places"], ["unused"]),
        onnx.helper.make_node("Relu", ["features"], ["output"]),
    ]
    file.write_bytes(graph_of(nodes, {}, ("features", "places")))
    with pytest.raises(Fleet2DError, match="a number for each bin and place"):
        beliefs({"type": "onnx", "file": str(file)})
