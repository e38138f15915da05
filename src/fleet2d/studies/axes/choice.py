"""The choices of an axis: the labels of each, and its changes of the scenario."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fleet2d.document import Keys
from fleet2d.errors import ScenarioError

Label = str | int | float | bool | None
"""The name of a choice in tables and messages; None where the axis does not apply."""


@dataclass(frozen=True)
class Choice:
    """One value of an axis.

    Attributes:
        labels: Its label by column; an axis has one column, a group one for each of its axes.
        changes: (key path, value) pairs that it sets in the scenario.
    """

    labels: Mapping[str, Label]
    changes: tuple[tuple[Keys, Any], ...] = field(default=(), compare=False)

    @property
    def words(self) -> str:
        """The choice as messages name it.

        >>> Choice({"speed": 0.3, "robot": "slow"}).words
        'speed = 0.3, robot = slow'
        """
        return ", ".join(f"{column} = {label}" for column, label in self.labels.items())


def key_path(text: str) -> Keys:
    """Split 'robots.astro.speed' into its keys.

    Raises:
        ScenarioError: A part is empty.
    """
    keys = tuple(part.strip() for part in text.split("."))
    if not all(keys):
        raise ScenarioError(f"expected a key path like robots.astro.speed, got {text!r}")
    return keys


def label_values(values: Sequence[Any]) -> list[Label]:
    """Return a label for each value: itself, else its `type`, else its number from 1.

    >>> label_values([0.3, "fast"]), label_values([{"type": "patrol"}, {"type": "hangout"}])
    ([0.3, 'fast'], ['patrol', 'hangout'])
    """
    labels = [_own_label(value) for value in values]
    if None not in labels and len({repr(label) for label in labels}) == len(values):
        return labels
    if all(value is None or isinstance(value, str | int | float) for value in values):
        return ["none" if label is None else label for label in labels]
    return [f"{number}" for number in range(1, len(values) + 1)]


def _own_label(value: Any) -> Label:
    if isinstance(value, str):
        return str(value)
    if isinstance(value, bool | int | float):
        return value
    kind = value.get("type") if isinstance(value, Mapping) else None
    return str(kind) if isinstance(kind, str) else None
