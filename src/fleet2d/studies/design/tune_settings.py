"""The `tune` section of a study file."""

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from fleet2d.component import Settings
from fleet2d.problems import problem
from fleet2d.studies.axes.sampling import Parameter
from fleet2d.units import PositiveDuration


class TuneSettings(Settings):
    """The searched parameters, the objectives, and the homes on which the results are judged.

    Attributes:
        search: The parameters, by name.
        objectives: Metrics such as ltp_error.ana.tv, each with the better direction.
        trials: The number of settings to try.
        held_out: {axis: [values]}: unknown to the search, used only by the report.
        prune_at: Simulated times at which poor trials end early; with one objective only.
        seed: The seed of the search.
    """

    search: dict[str, Parameter] = Field(min_length=1)
    objectives: dict[str, Literal["minimize", "maximize"]] = Field(min_length=1)
    trials: int = Field(default=40, ge=1)
    held_out: dict[str, tuple[Any, ...]] = Field(min_length=1, max_length=1)
    prune_at: tuple[PositiveDuration, ...] = ()
    seed: int = Field(default=0, ge=0)

    @model_validator(mode="after")
    def _prunes_by_one_objective(self) -> Self:
        if self.prune_at and len(self.objectives) > 1:
            raise problem(
                "prune_at needs one objective: with several objectives no trial can end early"
            )
        if list(self.prune_at) != sorted(set(self.prune_at)):
            raise problem("prune_at needs times in ascending order")
        return self
