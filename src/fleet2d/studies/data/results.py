"""The results of a study so far: from its committed parts and from its journal."""

import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fleet2d.studies.data.directory import PLAN, VARIANTS, StudyDirectory
from fleet2d.studies.data.journal import read_journal
from fleet2d.studies.data.parts import VARIANT, Part, read_results, results_table

if TYPE_CHECKING:
    import pyarrow as pa

_STATE = b"fleet2d.parts"
_PLAN_ONLY = ("identity", "scenario", "template", "home_key")  # no columns of `variants`
MISSING = "missing"


@dataclass(frozen=True)
class Counts:
    """How far a study is.

    Attributes:
        total: The number of its variants.
        complete: The number of variants that are complete.
        failed: The number of variants that failed.
    """

    total: int
    complete: int
    failed: int

    @classmethod
    def of(cls, statuses: Sequence[str | None]) -> Self:
        """Count the statuses of variants."""
        return cls(len(statuses), statuses.count("complete"), statuses.count("failed"))

    @property
    def missing(self) -> int:
        """The number of variants without results."""
        return self.total - self.complete - self.failed


def statuses(directory: StudyDirectory, parts: Iterable[Part]) -> dict[int, str]:
    """Return the status of each variant with results, by number; the newest result counts."""
    parts = tuple(parts)
    status_of: dict[int, str] = {}
    for table in read_results(directory.storage, parts):
        status_of |= zip(
            table.column(VARIANT).to_pylist(), table.column("status").to_pylist(), strict=True
        )
    for record in read_journal(directory.journal_path(parts)):
        status_of[record.number] = record.header["status"]
    return status_of


def count(directory: StudyDirectory) -> Counts:
    """Return how far a study is."""
    numbers = directory.read_table(PLAN, [VARIANT]).column(VARIANT).to_pylist()
    status_of = statuses(directory, directory.parts())
    return Counts.of([status_of.get(number) for number in numbers])


def assemble(directory: StudyDirectory) -> "pa.Table":
    """Return `variants`: parameters, status, time, digest, metrics, in the order of the design."""
    import pyarrow as pa

    parts = directory.parts()
    headers = [record.header for record in read_journal(directory.journal_path(parts))]
    results = list(read_results(directory.storage, parts))
    if headers or not results:
        results.append(results_table(headers))
    table = pa.concat_tables(results, promote_options="default")
    plan = directory.read_table(PLAN)
    rows = _newest_rows(table.column(VARIANT).to_numpy(), plan.column(VARIANT).to_numpy())
    newest = table.take(pa.array(rows, pa.int64(), mask=rows < 0))
    columns = {name: plan.column(name) for name in plan.column_names if name not in _PLAN_ONLY}
    columns |= {name: newest.column(name) for name in newest.column_names if name != VARIANT}
    columns["status"] = columns["status"].fill_null(MISSING)
    return pa.table(columns).replace_schema_metadata({_STATE: _state(parts, bool(headers))})


def variants_table(directory: StudyDirectory) -> "pa.Table":
    """Return `variants`, read from its file if that is up to date."""
    parts = directory.parts()
    has_journal = next(read_journal(directory.journal_path(parts)), None) is not None
    if not has_journal:
        with suppress(FileNotFoundError):
            table = directory.read_table(VARIANTS)
            if (table.schema.metadata or {}).get(_STATE) == _state(parts, has_journal=False):
                return table
    return assemble(directory)


def write_variants(directory: StudyDirectory) -> None:
    """Write `variants.parquet`."""
    directory.write_table(VARIANTS, assemble(directory))


def _newest_rows(numbers: Any, variants: Any) -> Any:
    """Return the last row of each variant in a table of results, -1 where there is none.

    Args:
        numbers: The variant of each row of the results: int32 (rows,).
        variants: The variants to look up: int32 (variants,).
    """
    rows = np.full(max(numbers.max(initial=-1), variants.max(initial=-1)) + 2, -1, np.int64)
    rows[numbers] = np.arange(len(numbers))
    return rows[variants]


def _state(parts: Iterable[Part], has_journal: bool) -> bytes:
    sizes = [[part.number, *(file.sha256[:16] for file in part.files)] for part in parts]
    return json.dumps([sizes, has_journal]).encode()
