"""Networks in ONNX files, which count as code, since one may run for ever or fill the memory."""

from collections.abc import Collection, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.bounds import FILE_BYTES, one_line, read_bytes
from fleet2d.configuration.trust import NETWORK, check_may_run
from fleet2d.errors import ComponentError, InputError, extra


def open_network(path: Path, inputs: Collection[str]) -> Any:
    """Return a network that is ready to compute, on one thread: a session of onnxruntime.

    Args:
        path: The file.
        inputs: The names that its inputs may have.

    Raises:
        InputError: The file isn't such a network, onnxruntime isn't installed, or the file may not
            run: an untrusted stored run or scenario of others names it.
    """
    if path.suffix != NETWORK:  # files that run are listed by this suffix
        raise InputError(f"{path} is no ONNX model: its suffix isn't {NETWORK}")
    check_may_run(str(path), [path.resolve()])
    try:
        session = _session(path, path.stat().st_mtime_ns)
    except OSError as error:
        raise InputError(f"{path} can't be read: {error.strerror or error}") from None
    names = [part.name for part in session.get_inputs()]
    if not names or not set(names) <= set(inputs):
        raise InputError(
            f"{path} has the inputs {', '.join(names) or 'none'}, expected {' and '.join(inputs)}"
        )
    return session


@lru_cache(maxsize=8)
def _session(path: Path, _: int) -> Any:
    """Return the session of a file; a later time of writing gives a new one."""
    with extra("onnx", "networks in ONNX files need onnxruntime"):
        import onnxruntime
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    content = read_bytes(path, FILE_BYTES)
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # noqa: BLE001 - the runtime's own errors have no public base
        raise InputError(f"{path} is no ONNX model: {one_line(error, 120)}") from None


def compute(path: Path, inputs: Mapping[str, Any]) -> Any:
    """Return the first output of a network, an array of numbers without NaN.

    Args:
        path: The file.
        inputs: The arrays by the names of its inputs, which needn't have all of them.

    Raises:
        InputError: As `open_network`.
        ComponentError: The network fails, or returns something else.
    """
    session = open_network(path, inputs)
    try:
        given = {part.name: inputs[part.name] for part in session.get_inputs()}
        output = np.asarray(session.run(None, given)[0])
    except Exception as error:  # noqa: BLE001 - as above
        raise ComponentError(f"{path} failed: {one_line(error, 200)}") from None
    if output.dtype.kind not in "biuf":
        raise ComponentError(f"{path} returned {output.dtype}, expected numbers")
    if np.isnan(output).any():
        raise ComponentError(f"{path} returned NaN, not a number: train it again")
    return output
