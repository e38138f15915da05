"""Reading a study: its variants and its tables as one data set that needn't fit into memory."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.configuration.problems import suggest
from fleet2d.errors import ArtifactError
from fleet2d.studies import fleet
from fleet2d.studies.answers import StudyAnswers
from fleet2d.studies.directory import META, StudyDirectory
from fleet2d.studies.results import TABLES, VARIANT, part_names, table_files
from fleet2d.studies.sentences import Conclusion, StudyAnswer
from fleet2d.studies.storage import damaged

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow.dataset as pads

    from fleet2d.runs.run import Run
    from fleet2d.studies.specification import PairedComparison


class Study(StudyAnswers):
    """A study that was run completely or partly.

    Attributes:
        location: The folder or store, without secrets.
        meta: The description of the study: name, columns, populations, comparisons.
        columns: The columns of the axes, the seed last.
        populations: The columns whose values are a sample of a population.

    Example:
        >>> study = open_study("studies/speed")  # doctest: +SKIP
        >>> study.variants.head(2)  # doctest: +SKIP
    """

    def __init__(self, directory: StudyDirectory) -> None:
        """Read the description; results are read when they are used."""
        self._directory = directory
        self.location = directory.location
        self.meta = directory.read_meta()
        self.columns = self.meta.columns
        self.populations = self.meta.populations

    def __repr__(self) -> str:
        """Return its location and its progress."""
        counts = self.counts
        return f"<Study {self.location}: {counts.complete} of {counts.total} variants complete>"

    @property
    def answer(self) -> Conclusion:
        """The findings in sentences and a table, as `print` and notebooks show them."""
        answer = fleet.with_fleet(self, StudyAnswer(self).answer())
        if self.meta.rollout is None:
            return answer
        from fleet2d.studies.rollout import with_rollout  # few studies have a rollout

        return with_rollout(self, answer)

    def _repr_html_(self) -> str:
        return self.answer._repr_html_()

    @cached_property
    def variants(self) -> "pl.DataFrame":
        """The variants, a row each: parameters, status, time, digest and metrics.

        Raises:
            RunDirectoryError: Files of the study are missing or damaged.
        """
        frame = self._directory.variants()
        missing = {*self.columns, "simulated_s"} - {*frame.columns}
        if missing:
            raise damaged(self.location, f"its variants have no {', '.join(sorted(missing))}")
        return frame

    @cached_property
    def comparisons(self) -> "tuple[PairedComparison, ...]":
        """The comparisons that the study file asks for.

        Raises:
            RunDirectoryError: Their description is damaged.
        """
        from fleet2d.studies.specification import PairedComparison

        with self._directory.storage.reading(META):
            return tuple(map(PairedComparison.model_validate, self.meta.compare))

    @cached_property
    def tables(self) -> tuple[str, ...]:
        """The names of the tables that the study keeps and that have rows."""
        return tuple(sorted({name for files in self._files for name in files}))

    def arrow(self, table: str) -> "pads.Dataset":
        """Return a table of all variants as an Arrow data set, its first column `variant`.

        Raises:
            ArtifactError: The study keeps no such table.
        """
        import pyarrow as pa
        import pyarrow.dataset as pads

        if table not in self.tables:
            raise ArtifactError(
                f"the study has no table {table!r}{suggest(table, self.tables, 'It has')};"
                " keep.tables in the study file names them"
            )
        storage = self._directory.storage
        with storage.reading(f"{TABLES}/{table}"):
            paths = [storage.path(files[table]) for files in self._files if table in files]
            schemas = [pads.dataset(path, filesystem=storage.filesystem).schema for path in paths]
            if any((s.names[:1], s.types[:1]) != ([VARIANT], [pa.int32()]) for s in schemas):
                raise ValueError("it has no numbers of variants")
            schema = pa.unify_schemas(schemas, promote_options="permissive")
            return pads.dataset(paths, schema, filesystem=storage.filesystem, format="parquet")

    def polars(self, table: str) -> "pl.LazyFrame":
        """Return a table of all variants with their parameters as a lazy frame.

        Raises:
            ArtifactError: The study keeps no such table.
        """
        import polars as pl

        rows = pl.scan_pyarrow_dataset(self.arrow(table))
        parameters = self.variants.lazy().select(VARIANT, *self.columns)
        return rows.join(parameters, on=VARIANT, how="inner")

    def pandas(self) -> "pd.DataFrame":
        """Return the variants as a pandas data frame."""
        return self.variants.to_pandas()

    def percentiles(self, metric: str) -> "pl.DataFrame":
        """Return percentiles of a metric over the robots of a fleet; see `fleet.percentiles`."""
        return fleet.percentiles(self, metric)

    def worst(self, metric: str, share: float = fleet.WORST_SHARE) -> "pl.DataFrame":
        """Return the worst robots of a fleet, with their runs; see `fleet.worst`."""
        return fleet.worst(self, metric, share)

    def groups(self, metric: str, against: Mapping[str, Any] | None = None) -> "pl.DataFrame":
        """Return groups of robots that differ; see `fleet.groups`."""
        return fleet.groups(self, metric, against)

    def scenario(self, variant: int) -> dict[str, Any]:
        """Return the scenario of a variant, with its seed, as `fleet2d.run` takes it.

        Raises:
            RunDirectoryError: There is no such variant.
        """
        return self._directory.scenario(variant)

    def rerun(
        self,
        variant: int,
        out: str | Path | None = None,
        *,
        trust: bool = False,
        **settings: Any,
    ) -> "Run":
        """Run one variant again.

        Args:
            variant: Its number.
            out: Where to store the run; None: in memory.
            trust: Whether its own code and programs may run, if it has some.
            settings: Changes of the scenario, as of `fleet2d.run`, such as more `artifacts`.

        Raises:
            RunDirectoryError: There is no such variant, or the directory can't be used.
            UntrustedCodeError: It has code of its own, and isn't trusted.
        """
        from fleet2d.configuration.trust import stored_code
        from fleet2d.studies.simulator import run_scenario

        scenario = self.scenario(variant)
        with stored_code(f"variant {variant} of {self._directory.location}", scenario, trust=trust):
            return run_scenario(scenario, out=out, **settings)

    @cached_property
    def _files(self) -> list[dict[str, str]]:
        """The files of the tables of each part."""
        storage = self._directory.storage
        return [table_files(storage, name) for name in part_names(storage)]


def open_study(location: str | Path) -> Study:
    """Open a study for reading, even while it is being run.

    Args:
        location: The folder that `fleet2d study run` wrote, or a location like s3://bucket/study.

    Raises:
        RunDirectoryError: There is no study.
        InputError: polars is not installed.
    """
    return Study(StudyDirectory(location))
