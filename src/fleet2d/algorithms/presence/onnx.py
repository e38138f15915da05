"""Models of real-time presence in ONNX files, made by any library."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.algorithms.presence.learned import PLACE_FEATURES, CorrectedRoutine
from fleet2d.bounds import one_line
from fleet2d.configuration.components import register
from fleet2d.configuration.units import InputPath
from fleet2d.errors import ComponentError, InputError
from fleet2d.kernels import F64, TRACE_FEATURES

INPUTS = ("features", "places")


@register("presence_model", "onnx")
class OnnxModel(CorrectedRoutine):
    """The belief of `routine`, corrected by a network of your own in an ONNX file.

    Inputs are `features`, float32 (bins, places, 25), and `places`, float32 (places, 12), as
    `fleet2d.datasets.windows` has them; the output is float32 (bins, places), probabilities or
    scores of which the softmax is taken, away last. Homes differ in the number of places. It needs
    the package onnxruntime (`pip install "fleet2d[onnx]"`), whose results may differ in the last
    digits between machines: so may the run.

    Attributes:
        file: The ONNX file.
        scores: Whether its output are scores rather than probabilities.
    """

    file: InputPath
    scores: bool = True

    def check(self) -> None:
        """Refuse a file that is no ONNX model with these inputs.

        Raises:
            InputError: It isn't, or onnxruntime is missing.
        """
        _session(Path(self.file))

    def correct(self, features: F64) -> F64:
        """Return the probability of each place by the network.

        Raises:
            ComponentError: The output has another shape, or isn't finite.
        """
        inputs = {
            "features": features.astype(np.float32),
            "places": self.facts.features.astype(np.float32),
        }
        output = np.asarray(_session(Path(self.file)).run(None, inputs)[0], np.float64)
        if output.shape != features.shape[:2] or not np.isfinite(output).all():
            raise ComponentError(
                f"{self.file} returned an array of shape {output.shape}, expected finite numbers of"
                f" shape {features.shape[:2]}: a number for each bin and place"
            )
        if self.scores:
            output = np.exp(output - output.max(axis=1, keepdims=True))
        output = np.maximum(output, 0)
        return output / np.maximum(output.sum(axis=1, keepdims=True), 1e-12)


@cache
def _session(path: Path) -> Any:
    """Return a model that is ready to run, on one thread."""
    try:
        import onnxruntime
    except ImportError:
        raise InputError(
            'models in ONNX files need onnxruntime: pip install "fleet2d[onnx]"'
        ) from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(
            path.read_bytes(), options, providers=["CPUExecutionProvider"]
        )
    except Exception as error:  # noqa: BLE001 - the runtime's own errors have no public base
        raise InputError(f"{path} is no ONNX model: {one_line(error, 120)}") from None
    names = tuple(sorted(part.name for part in session.get_inputs()))
    if names != INPUTS:
        raise InputError(
            f"{path} has the inputs {', '.join(names)}, expected features (bins, places,"
            f" {TRACE_FEATURES}) and places (places, {PLACE_FEATURES})"
        )
    return session
