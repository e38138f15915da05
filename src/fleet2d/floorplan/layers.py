"""Layers: named arrays with a value for each cell."""

import math
from collections.abc import Callable, Iterator, Mapping
from datetime import timedelta
from typing import Any, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem_at, suggest
from fleet2d.configuration.units import PositiveDuration
from fleet2d.errors import ComponentError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.storage.names import problem_of

LayerType = Literal[
    "bool", "int", "float", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32",
    "float32", "float64",
]  # fmt: skip

SEEN_LAYERS = ("explored", "first_seen", "last_seen", "time_since_seen")
"""Layers that a run itself maintains for each robot with a camera, as NAME.ROBOT."""
COSTMAP = "costmap"


class LayerSettings(Settings):
    """A layer of the floor plan: type and unit of its values, and when it is stored.

    Attributes:
        dtype: Type of the values.
        fill: Initial value of every cell.
        unit: Unit of the values.
        description: One line for a reader of the file.
        store: Whether a run stores it at its end.
        every: How often it is stored besides; null: only at the end.
    """

    dtype: LayerType = "float"
    fill: float = 0.0
    unit: str = ""
    description: str = ""
    store: bool = True
    every: PositiveDuration | None = None

    @model_validator(mode="after")
    def _fill_fits(self) -> Self:
        if not holds(np.dtype(self.dtype), self.fill):
            raise problem_at(("fill",), f"{self.fill:g} is not a value of {self.dtype}")
        if self.every is not None and not self.store:
            raise problem_at(("every",), "the layer isn't stored: leave out 'every' or 'store'")
        return self


def check_layers(layers: dict[str, LayerSettings]) -> dict[str, LayerSettings]:
    """Refuse invalid names, and settings that don't apply to layers which the run maintains."""
    for name, settings in layers.items():
        if problem := problem_of(name):
            raise problem_at((name,), f"the name {name!r} {problem}")
        if name in (*SEEN_LAYERS, COSTMAP):
            for key, value in LayerSettings():
                if key in ("store", "every") or getattr(settings, key) == value:
                    continue  # a stored scenario has all keys
                text = f"{name} is a layer that the run maintains itself: leave out {key!r}"
                raise problem_at((name, key), text)
    return layers


def holds(dtype: np.dtype[Any], value: float) -> bool:
    """Return whether an array of a type can hold a number exactly (floats: about)."""
    if dtype.kind == "f":
        return math.isnan(value) or abs(value) <= float(np.finfo(dtype).max)
    if not math.isfinite(value) or value != int(value):
        return False
    if dtype.kind == "b":
        return value in (0, 1)
    info = np.iinfo(dtype)
    return int(info.min) <= value <= int(info.max)


class Layer:
    """A value for each cell of a floor plan.

    Attributes:
        name: Its name.
        fill: Initial value of every cell.
        unit: Unit of the values.
        description: A line that says what it is.
        store: Whether a run stores it at its end.
        every: Interval at which it is also stored before; None for never.
    """

    def __init__(
        self,
        name: str,
        plan: FloorPlan,
        settings: LayerSettings,
        source: Callable[[], NDArray[Any]] | None = None,
    ) -> None:
        """Make a layer filled with its initial value, or one whose values come from `source`."""
        self.name = name
        self.settings = settings
        self.fill: float = settings.fill
        self.unit = settings.unit
        self.description = settings.description
        self.store = settings.store
        self.every = settings.every
        self.dtype: np.dtype[Any] = np.dtype(settings.dtype)
        self._plan = plan
        self._source = source
        shape = (plan.lattice.rows, plan.lattice.columns)
        if source is None:
            self._values: NDArray[Any] = np.full(shape, settings.fill, self.dtype)

    def __repr__(self) -> str:
        """Return name, type and unit."""
        return f"<Layer {self.name}: {self.dtype}{f' [{self.unit}]' if self.unit else ''}>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the values, for NumPy functions."""
        return np.array(self.values, dtype=dtype, copy=copy)

    @property
    def values(self) -> NDArray[Any]:
        """The values (rows, columns); write to the array, or assign another.

        The values of a layer that the run maintains itself are recomputed, and are a copy.
        """
        return self._values if self._source is None else self._source()

    @values.setter
    def values(self, values: object) -> None:
        self._check_writable()
        self._values[...] = values

    def at(self, x: float, y: float) -> Any:
        """Return the value of the cell that holds a place [m].

        Raises:
            ComponentError: The place is outside the floor plan's grid.
        """
        return self.values[self._cell(x, y)].item()

    def set_at(self, x: float, y: float, value: float) -> None:
        """Change the value of the cell that holds a place [m].

        Raises:
            ComponentError: The place is outside the grid, or the run keeps the layer itself.
        """
        self._check_writable()
        self._values[self._cell(x, y)] = value

    def _check_writable(self) -> None:
        if self._source is not None:
            raise ComponentError(f"the layer {self.name} is maintained by the run: it is read-only")

    def _cell(self, x: float, y: float) -> tuple[int, int]:
        lattice = self._plan.lattice
        row, column = lattice.cell_of(*lattice.point_at((x, y)))
        if not (0 <= row < lattice.rows and 0 <= column < lattice.columns):
            raise ComponentError(f"({x:g}, {y:g}) m is outside the grid of {self._plan.name}")
        return row, column


class Layers(Mapping[str, Layer]):
    """The layers of a home in a run, by name; copied with it.

    Example:
        >>> import fleet2d
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> dust = home.layers.add("dust", "float32", unit="g", description="on the floor")
        >>> dust.values[home.plan.free] += 0.5
        >>> float(home.layers["dust"].at(*home.rooms[0].anchor_xy))
        0.5
    """

    def __init__(self, plan: FloorPlan) -> None:
        """Make a mapping without layers."""
        self._plan = plan
        self._layers: dict[str, Layer] = {}

    def __getitem__(self, name: str) -> Layer:
        """Return a layer.

        Raises:
            ComponentError: No layer has that name.
        """
        if name not in self._layers:
            base = name.partition(".")[0]
            advice = (
                f"to have it kept, write floorplan.layers.{base}: {{}} in the scenario, or"
                f" needs = {{{base!r}}} in an algorithm"
                if base in SEEN_LAYERS
                else "add it by home.layers.add(), or in the scenario under floorplan.layers"
            )
            raise ComponentError(
                f"there is no layer {name!r}{suggest(name, self._layers)}; {advice}"
            )
        return self._layers[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._layers)

    def __len__(self) -> int:
        """Return the number of layers."""
        return len(self._layers)

    def __contains__(self, name: object) -> bool:
        """Return whether there is a layer of that name."""
        return name in self._layers

    def add(
        self,
        name: str,
        dtype: LayerType = "float",
        fill: float = 0.0,
        unit: str = "",
        description: str = "",
        *,
        store: bool = True,
        every: timedelta | None = None,
    ) -> Layer:
        """Add a layer and return it; one of the same name, type and unit is returned as it is.

        Args:
            name: Its name: letters, digits, '_' and '-'.
            dtype: Type of the values.
            fill: Initial value of every cell.
            unit: Unit of the values.
            description: A line that says what it is.
            store: Whether the run stores it at its end.
            every: Interval at which it is also stored before.

        Raises:
            ComponentError: The name is taken by another layer, or something is wrong with it.
        """
        if dtype not in get_args(LayerType):
            known = ", ".join(get_args(LayerType))
            raise ComponentError(f"layer {name!r}: there is no dtype {dtype!r}; there are: {known}")
        if not holds(np.dtype(dtype), fill):
            raise ComponentError(f"layer {name!r}: its fill value, {fill:g}, doesn't fit {dtype}")
        if name.partition(".")[0] in (*SEEN_LAYERS, COSTMAP):
            raise ComponentError(
                f"layer {name!r} is one that the run maintains itself: rename yours"
            )
        settings = LayerSettings.model_construct(
            dtype=dtype, fill=fill, unit=unit, description=description, store=store, every=every
        )
        return self.add_layer(name, settings)

    def add_layer(
        self, name: str, settings: LayerSettings, source: Callable[[], NDArray[Any]] | None = None
    ) -> Layer:
        """Add a layer as a scenario describes it; see `add`."""
        base, dot, body = name.partition(".")  # `body`: that of a layer of what a robot has seen
        if problem := problem_of(base) or (problem_of(body) if dot else None):
            raise ComponentError(f"a layer can't be named {name!r}: the name {problem}")
        layer = self._layers.get(name)
        if layer is None:
            layer = self._layers[name] = Layer(name, self._plan, settings, source)
        elif (layer.dtype, layer.unit) != (np.dtype(settings.dtype), settings.unit):
            raise ComponentError(
                f"there is a layer {name!r} of {layer.dtype} [{layer.unit}] already: name yours"
                " otherwise"
            )
        return layer
