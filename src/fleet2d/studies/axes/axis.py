"""The base class of the axes of a study."""

from typing import Any, ClassVar

from pydantic import Field

from fleet2d.component import Settings
from fleet2d.studies.axes.choice import Choice


class Axis(Settings):
    """Base class of axes.

    Attributes:
        is_population: Whether its values are a sample of a population (homes, people); the
            intervals of answers hold over populations.
        when: The axis applies only where other axes have these values: {robot: hangout}; a list:
            any of them.
    """

    is_population: ClassVar[bool] = False

    when: dict[str, Any] = Field(default={})

    def columns(self, name: str) -> tuple[str, ...]:
        """Return the columns of its labels."""
        return (name,)

    def populations(self, name: str) -> tuple[str, ...]:
        """Return its columns whose values are a sample of a population."""
        return self.columns(name) if self.is_population else ()

    def choices(self, name: str) -> list[Choice]:
        """Return the label and the scenario changes of each value of the axis, in order.

        Raises:
            InputError: A file or a package is missing.
        """
        raise NotImplementedError
