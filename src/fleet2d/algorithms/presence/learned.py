"""Learned models of real-time presence: networks over all places that correct `routine`."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.presence.belief import BeliefSeries, Presence
from fleet2d.algorithms.presence.chain_model import ChainPresence, RoutineModel, split
from fleet2d.algorithms.presence.estimator import array_of, natural_log
from fleet2d.bounds import WEIGHTS_BYTES, one_line
from fleet2d.configuration.networks import compute, open_network
from fleet2d.configuration.units import InputPath
from fleet2d.errors import ComponentError, InputError
from fleet2d.floorplan.home import Home
from fleet2d.kernels import (
    F64,
    I64,
    TRACE_FEATURES,
    PlaceNetwork,
    TracedEvidence,
    TracedRooms,
    place_probabilities,
    trace_evidence,
    trace_size,
)
from fleet2d.storage.archives import read_arrays
from fleet2d.storage.files import partial_file

WEIGHTS = Path(__file__).with_name("learned.npz")
FORMAT = "fleet2d presence network 2"  # changes with the features, and with the network
INPUTS = ("features", "places")
"""The names of the inputs of a model in a file."""
MAX_HIDDEN = 256
MIN_SHARE = 1e-9
# Kinds of rooms that mean the same; other kinds are one more group, and being away another.
GROUPS = (
    ("bedroom", "child_room", "guest_room"),
    ("bathroom", "toilet"),
    ("kitchen",),
    ("living_room",),
    ("dining_room",),
    ("office",),
    ("hallway", "hall", "entryway", "lobby"),
)
GROUP_OF_KIND = {kind: number for number, kinds in enumerate(GROUPS) for kind in kinds}
PLACE_FEATURES = len(GROUPS) + 5
GAP = 18  # the feature that is ln(1 + minutes since the newest sighting)
# Ends of the classes of gaps that are trusted differently: gaps are whole minutes where bins are.
TRUST_ENDS = natural_log(1 + np.array([1.5, 5.5, 15.5, 60.5, 240.5]))
TRUSTS = len(TRUST_ENDS) + 1


class PlaceFacts(NamedTuple):
    """Facts about the places of a home, which mean the same in all homes.

    Attributes:
        features: float64 (rooms + 1, PLACE_FEATURES), away last: the group of the kind of room, the
            logarithm of its area [m²], its share of the floor, and one by the rooms of that group.
        rooms: Shares of the floor, and distances.
    """

    features: F64
    rooms: TracedRooms

    @classmethod
    def of(cls, kinds: Sequence[str], area_m2: Sequence[float], xy: Sequence[Any]) -> Self:
        """Return the facts about rooms, from their kinds, areas, and middles [m].

        Example:
            >>> facts = PlaceFacts.of(["kitchen", "loft"], [12.0, 4.0], [(0, 0), (3, 4)])
            >>> facts.features[:, 2].tolist(), facts.rooms.distance.tolist()
            ([1.0, 0.0, 0.0], [[0.0, 0.5], [0.5, 0.0]])
        """
        groups = [GROUP_OF_KIND.get(kind, len(GROUPS)) for kind in kinds]
        area = np.maximum(area_m2, 0.01)
        count = len(groups)
        features = np.zeros((len(groups) + 1, PLACE_FEATURES))
        features[np.arange(count), groups] = 1
        features[count, len(GROUPS) + 1] = 1
        features[:count, -3] = natural_log(area)
        features[:count, -2] = share = area / area.sum()
        features[:count, -1] = 1 / np.bincount(groups)[groups]
        middle = np.array(xy, np.float64)
        gaps = middle[:, None] - middle[None]
        return cls(features, TracedRooms(share, np.sqrt((gaps * gaps).sum(axis=2)) / 10))

    @classmethod
    def of_home(cls, home: Home) -> Self:
        """Return the facts about the rooms of a home."""
        columns = zip(*((r.type, r.area_m2, r.anchor_xy) for r in home.rooms), strict=True)
        return cls.of(*columns)


class Weights(NamedTuple):
    """A trained network.

    Attributes:
        places: float64 (PLACE_FEATURES, hidden), the part of the first layer for `PlaceFacts`.
        start: float64 (hidden,), the bias of the first layer.
        trust: float64 (TRUSTS,), by the gap since the newest sighting: how much of the network's
            correction counts. The longer the gap, the more it depends on habits, and people differ
            from those of the training.
        network: The rest.
    """

    places: F64
    start: F64
    trust: F64
    network: PlaceNetwork

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the weights of a file that `save` wrote.

        Raises:
            InputError: The file is damaged, no file of weights, or of another version.
        """
        try:
            arrays = read_arrays(path, WEIGHTS_BYTES)
        except InputError:
            raise
        except Exception as error:  # noqa: BLE001 - a damaged archive raises almost anything
            raise InputError(
                f"{path} can't be read as weights of a model of presence ({one_line(error, 100)}):"
                " give a file that `fleet2d dataset train` wrote, or `type: onnx` for an ONNX file"
            ) from None
        form = str(arrays.get("format", "nothing"))
        if form != FORMAT:
            raise InputError(
                f"{path} holds {form[:60]!r}, expected {FORMAT!r}: train it again with this version"
            )
        hidden = np.size(arrays.get("bias", ()))
        shapes = {
            "places": (PLACE_FEATURES, hidden),
            "start": (hidden,),
            "trust": (TRUSTS,),
            "first": (TRACE_FEATURES, hidden),
            "second": (hidden, hidden),
            "context": (hidden, hidden),
            "bias": (hidden,),
            "score": (hidden,),
        }
        if unknown := sorted(arrays.keys() - shapes.keys() - {"format"}):
            raise InputError(f"{path} has {unknown[0]!r}, which is no part of a model: remove it")
        for name, shape in shapes.items():
            part = arrays.get(name, np.zeros(()))
            fits = part.shape == shape and part.dtype == np.float32 and 0 < hidden <= MAX_HIDDEN
            if not fits or not np.isfinite(part).all():
                raise InputError(
                    f"{path} lacks finite weights {name!r} of shape {shape}: it is damaged"
                )
        values = {name: arrays[name].astype(np.float64) for name in shapes}
        places = values.pop("places")
        start = values.pop("start")
        trust = values.pop("trust")
        return cls(places, start, trust, PlaceNetwork(**values))

    def save(self, path: Path) -> None:
        """Write the weights to a .npz file, as float32."""
        arrays = {**self._asdict(), **self.network._asdict()}
        del arrays["network"]
        with partial_file(path) as partial, partial.open("wb") as file:
            np.savez(
                file,
                format=np.array(FORMAT),
                **{name: array.astype(np.float32) for name, array in arrays.items()},
            )

    def of_places(self, features: F64) -> F64:
        """Return the first layer's outputs for places: float64 (places, hidden)."""
        total = np.tile(self.start, (len(features), 1))
        for k, row in enumerate(self.places):  # in order: the same on every machine
            total += features[:, k, np.newaxis] * row
        return total

    def probabilities(self, places: F64, features: F64) -> F64:
        """Return the probability of each place in each bin: float64 (bins, places).

        Args:
            places: What `of_places` returned.
            features: float64 (bins, places, TRACE_FEATURES).
        """
        gap = trust_class(features)
        made = np.zeros(features.shape[:2])
        for k in np.unique(gap).tolist():
            trusted = self.network._replace(score=self.network.score * self.trust[k])
            made[gap == k] = place_probabilities(trusted, places, features[gap == k])
        return made


def trust_class(features: Any) -> I64:
    """Return the class of each bin's gap, which the trust depends on: int64 (bins,)."""
    return np.searchsorted(TRUST_ENDS, features[:, -1, GAP])


@cache
def shipped_weights() -> Weights:
    """Return the weights that ship with Fleet2D."""
    return Weights.read(WEIGHTS)


class CorrectedRoutine(RoutineModel):
    """Base of models that correct the belief of `routine`, from features of each place.

    A subclass writes `correct`.
    """

    def begin(self, home: Home, users: Sequence[str], start: datetime) -> None:
        """Prepare for a run."""
        super().begin(home, users, start)
        self.facts = PlaceFacts.of_home(home)
        self.traces = np.zeros((max(self.users, 1), trace_size(self.facts.rooms)))

    def correct(self, features: F64) -> F64:
        """Return the probability of each place: float64 (bins, places), rows sum to one.

        Args:
            features: float64 (bins, places, TRACE_FEATURES), away last; the last feature is the
                logarithm of the belief of `routine`.
        """
        raise NotImplementedError

    def observe(self, evidence: Evidence) -> tuple[F64, F64]:
        """Return the corrected belief after each bin."""
        home, away = super().observe(evidence)
        places = []
        for person, memory in enumerate(self.traces):
            chance = away[:, person, np.newaxis]
            prior = np.concatenate([home[:, person] * (1 - chance), chance], axis=1)
            of_person = traced(evidence, person, prior)
            places.append(self.correct(trace_evidence(memory, self.facts.rooms, of_person)))
        return split(places, self.users, evidence.sightings.unknown)

    def presence(
        self, users: Sequence[str], time: datetime, bin_us: int, track: BeliefSeries
    ) -> Presence:
        """Return the present belief; forecasts begin with it, and go on as those of `routine`."""
        forecast = super().presence(users, time, bin_us, track)
        assert isinstance(forecast, ChainPresence)
        return forecast.corrected()

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays in mappings."""
        return {**super().remember(), "traces": self.traces}

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Restore what `remember` returned; called after `begin`."""
        super().recall(learned)
        self.traces = array_of(learned, "traces", self.traces.shape)


class LearnedModel(CorrectedRoutine):
    """The belief of `routine`, corrected by a network that was trained on simulated homes.

    For each room, and for being away, the network gets what the evidence of a user has left there
    (when the user was last seen and where, what was looked at and empty since, sightings by hour of
    the day, moves between rooms), what the place is (kind, area), and the belief of `routine`. All
    places share the weights, so homes may have any number of rooms, and each user is followed
    alone. It was trained to have the lowest log loss, so its probabilities are calibrated where
    homes and people are like those of the training.

    It is right where `routine` is too sure, or too slow to give up a room. It fails where people
    live unlike those it was trained on; docs/how-to/datasets.md has the numbers.

    Attributes:
        weights: A file that `fleet2d dataset train` wrote; left out: the weights that ship.
    """

    weights: InputPath | None = None

    def check(self) -> None:
        """Refuse a file of weights that is damaged, foreign, or of another version."""
        self._read()

    def _read(self) -> Weights:
        return shipped_weights() if self.weights is None else Weights.read(self.weights)

    def begin(self, home: Home, users: Sequence[str], start: datetime) -> None:
        """Prepare for a run."""
        super().begin(home, users, start)
        self.trained = self._read()
        self.places = self.trained.of_places(self.facts.features)

    def correct(self, features: F64) -> F64:
        """Return the probability of each place by the network."""
        return self.trained.probabilities(self.places, features)


def traced(evidence: Evidence, person: int, belief: F64) -> TracedEvidence:
    """Return the evidence of one person.

    Args:
        evidence: The evidence of all.
        person: Row of the user; without users, 0 is anybody.
        belief: float64 (bins, rooms + 1), the belief to be corrected, away last.
    """
    bin_, room, steps = evidence.sightings.of_user(person)
    seen = np.zeros(evidence.watched.shape)
    seen[bin_, room] = steps / evidence.bin_steps
    unknown = evidence.sightings.unknown.astype(np.uint8)
    return TracedEvidence(evidence.day, evidence.minute, evidence.watched, seen, unknown, belief)


class OnnxModel(CorrectedRoutine):
    """The belief of `routine`, corrected by a network of your own in an ONNX file.

    Inputs are `features`, float32 (bins, places, 25), and `places`, float32 (places, 12), as
    `fleet2d.learning.datasets.windows` has them; the output is float32 (bins, places),
    probabilities or scores of which the softmax is taken, away last. Homes differ in the number of
    places. It needs the package onnxruntime (`pip install "fleet2d[onnx]"`), whose results may
    differ in the last digits between machines: so may the run.

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
        open_network(self.file, INPUTS)

    def correct(self, features: F64) -> F64:
        """Return the probability of each place by the network.

        Raises:
            ComponentError: The output has another shape, or isn't finite.
        """
        inputs = {
            "features": features.astype(np.float32),
            "places": self.facts.features.astype(np.float32),
        }
        output = compute(self.file, inputs).astype(np.float64)
        if output.shape != features.shape[:2] or not np.isfinite(output).all():
            raise ComponentError(
                f"{self.file} returned an array of shape {output.shape}, expected finite numbers of"
                f" shape {features.shape[:2]}: a number for each bin and place"
            )
        if self.scores:
            output = np.exp(output - output.max(axis=1, keepdims=True))
        output = np.maximum(output, 0)
        return output / np.maximum(output.sum(axis=1, keepdims=True), 1e-12)
