"""Windows for PyTorch: from a data set, or from fresh runs without an end."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.errors import InputError
from fleet2d.learning.datasets.reader import Dataset
from fleet2d.learning.datasets.specification import plan_dataset
from fleet2d.learning.datasets.tables import tables_of
from fleet2d.learning.datasets.tasks import windows
from fleet2d.learning.datasets.windows import Windows, windows_of

try:
    import torch
    from torch.utils.data import IterableDataset, get_worker_info
except ImportError:
    raise InputError('windows for PyTorch need torch: pip install "fleet2d[ml]"') from None


def torch_windows(data: Dataset, split: str, *, shuffle: int = 0, seed: int = 0) -> "TorchWindows":
    """Return the windows of a split, for a `DataLoader`, whose workers share its shards.

    Args:
        data: The data set.
        split: The split.
        shuffle: Size of the buffer from which windows are drawn; 0: in order.
        seed: The seed of the order.

    Example:
        >>> windows = torch_windows(data, "train", shuffle=1000)  # doctest: +SKIP
        >>> loader = torch.utils.data.DataLoader(windows, num_workers=2)  # doctest: +SKIP
    """
    return TorchWindows(partial(windows, data, split), shuffle, seed)


def fresh_windows(
    source: str | Path | Mapping[str, Any], split: str, *, shuffle: int = 0, seed: int = 0
) -> "TorchWindows":
    """Return windows of runs that are simulated as they are needed, each with fresh people.

    Args:
        source: The file of a data set, or the same as a mapping.
        split: The split whose homes and households are used.
        shuffle: Size of the buffer from which windows are drawn; 0: in order.
        seed: The seed of the order and of the runs.
    """
    return TorchWindows(partial(_fresh, source, split, seed), shuffle, seed)


class TorchWindows(IterableDataset):  # type: ignore[misc]
    """Windows as mappings of tensors: places, features, truth and belief, as in `Windows`.

    Homes differ in the number of places: batch windows of one home, or pad them.
    """

    def __init__(
        self, parts: Callable[[int, int], Iterator[Windows]], shuffle: int, seed: int
    ) -> None:
        """Keep the source of windows, by number of the worker and of all workers."""
        self._parts = parts
        self._shuffle = shuffle
        self._seed = seed

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield the windows of this worker."""
        info = get_worker_info()
        worker, workers = (info.id, info.num_workers) if info is not None else (0, 1)
        random = np.random.default_rng([self._seed, worker])
        waiting: list[dict[str, Any]] = []
        for part in self._parts(worker, workers):
            for window in _tensors(part):
                if len(waiting) < self._shuffle:
                    waiting.append(window)
                    continue
                if waiting:
                    k = int(random.integers(len(waiting)))
                    window, waiting[k] = waiting[k], window
                yield window
        for k in random.permutation(len(waiting)):
            yield waiting[k]


def _tensors(part: Windows) -> Iterator[dict[str, Any]]:
    places = torch.from_numpy(part.places.astype(np.float32))
    for features, truth, belief in zip(
        part.features, part.truth, part.beliefs["routine"], strict=True
    ):
        yield {
            "places": places,
            "features": torch.from_numpy(features),
            "truth": int(truth),
            "belief": torch.from_numpy(belief.astype(np.float32)),
        }


def _fresh(
    source: str | Path | Mapping[str, Any], split: str, seed: int, worker: int, workers: int
) -> Iterator[Windows]:
    from fleet2d.engine.simulation import run

    plan = plan_dataset(source)
    if split not in plan.file.splits:
        raise InputError(f"there is no split {split!r}: splits are {', '.join(plan.file.splits)}")
    number = worker
    while True:
        planned = plan.run(split, number)
        # Fresh runs have larger seeds than the data set itself.
        simulation = {
            **planned.scenario["simulation"],
            "seed": (1 << 31) + seed * 1_000_003 + number,
        }
        scenario = {**planned.scenario, "simulation": simulation}
        planned = replace(planned, number=number, scenario=scenario)
        yield from windows_of(tables_of(run(scenario), planned, plan.file.labels))
        number += workers
