"""Axes whose values are a sample of a population: homes and people."""

from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field

from fleet2d.errors import ScenarioError
from fleet2d.paths import folder_of
from fleet2d.problems import problem
from fleet2d.studies.axes.axis import Axis
from fleet2d.studies.axes.choice import Choice
from fleet2d.studies.axes.count import Count


def _texts(value: Any) -> tuple[Any, ...]:
    """Return a text or a list of texts as a tuple; each keeps the folder of its file."""
    texts = (value,) if isinstance(value, str | Path) else value
    if not isinstance(texts, list | tuple) or not all(isinstance(t, str | Path) for t in texts):
        raise problem(f"expected a text or a list of texts, got {value!r}")
    return tuple(texts)


Texts = Annotated[Any, BeforeValidator(_texts)]


class FloorplansAxis(Axis):
    """Floor plans: the files of a folder or a pattern, or a list of files.

    Attributes:
        floorplans: A folder, a pattern, or files.
        settings: Further keys of the floor plan, such as furnish.
    """

    is_population: ClassVar[bool] = True

    floorplans: Texts
    settings: dict[str, Any] = Field(default={})

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each floor plan; its label is the name of its file.

        Raises:
            ScenarioError: There is no such file, or one is not a floor plan.
        """
        files = self._files()
        labels = [path.stem for path in files]
        if len(set(labels)) < len(labels):
            labels = [path.name for path in files]
        return [
            Choice({name: label}, ((("floorplan",), self._section(path)),))
            for label, path in zip(labels, files, strict=True)
        ]

    def _files(self) -> list[Path]:
        from fleet2d.floorplan.load import plan_suffixes

        files: list[Path] = []
        suffixes = plan_suffixes()
        for pattern in self.floorplans:
            path = folder_of(pattern) / Path(pattern).expanduser()
            candidates = path.iterdir() if path.is_dir() else path.parent.glob(path.name)
            plans = sorted(p for p in candidates if p.suffix.lower() in suffixes)
            if not plans:
                raise ScenarioError(
                    f"no floor plan matches {pattern!r} in {folder_of(pattern)}: name a folder, a"
                    f" pattern or a file that ends in {', '.join(suffixes)}"
                )
            files += plans
        return files

    def _section(self, path: Path) -> dict[str, Any]:
        from fleet2d.floorplan.load import format_of_file

        return {"type": format_of_file(path), "path": str(path.absolute()), **self.settings}


class SyntheticAxis(Axis):
    """Synthetic homes by their seeds.

    Attributes:
        synthetic: The number of homes, from seed 0 on; or a list of seeds.
        first: The first seed, if `synthetic` is a number.
        settings: Further keys of the homes, such as area_m2 and furnish.
    """

    is_population: ClassVar[bool] = True

    synthetic: Count | tuple[int, ...]
    first: int = Field(default=0, ge=0)
    settings: dict[str, Any] = Field(default={})

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each home; its label is its seed."""
        seeds = self.synthetic
        if isinstance(seeds, int):
            seeds = tuple(range(self.first, self.first + seeds))
        return [
            Choice(
                {name: seed},
                ((("floorplan",), {"type": "synthetic", "seed": seed, **self.settings}),),
            )
            for seed in seeds
        ]


class PersonasAxis(Axis):
    """Personas of one user: the bundled ones, or files of your own.

    Attributes:
        personas: `all`, or a list of names and files.
        user: The name of the user who has the persona.
    """

    is_population: ClassVar[bool] = True

    personas: Texts
    user: str

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each persona."""
        from fleet2d.routines.persona import bundled_names

        personas = bundled_names() if self.personas == ("all",) else self.personas
        user = ("users", self.user)
        return [
            Choice(
                {name: Path(persona).stem},
                (((*user, "type"), "routine"), ((*user, "persona"), persona)),
            )
            for persona in personas
        ]
