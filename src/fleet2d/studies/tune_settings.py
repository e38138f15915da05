"""The `tune` section of a study file."""

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from fleet2d.component import Settings
from fleet2d.problems import problem
from fleet2d.studies.sampling import Parameter
from fleet2d.units import PositiveDuration


class TuneSettings(Settings):
    """What is searched, for which objectives, and on which homes it is judged."""

    search: dict[str, Parameter] = Field(min_length=1, description="the parameters, by name")
    objectives: dict[str, Literal["minimize", "maximize"]] = Field(
        min_length=1, description="numbers such as ltp_error.ana.tv, and which way is better"
    )
    trials: int = Field(default=40, ge=1, description="how many settings are tried")
    held_out: dict[str, tuple[Any, ...]] = Field(
        min_length=1,
        max_length=1,
        description="{axis: [values]}: never seen by the search, only by the report",
    )
    prune_at: tuple[PositiveDuration, ...] = Field(
        default=(),
        description="simulated times at which a setting that does badly is given up; with one"
        " objective only",
    )
    seed: int = Field(default=0, ge=0, description="of the search")

    @model_validator(mode="after")
    def _prunes_by_one_objective(self) -> Self:
        if self.prune_at and len(self.objectives) > 1:
            raise problem("prune_at wants one objective: by several nothing can be given up early")
        if list(self.prune_at) != sorted(set(self.prune_at)):
            raise problem("prune_at wants times in ascending order")
        return self
