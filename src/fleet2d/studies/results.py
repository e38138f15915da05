"""The results of a study so far: from its committed parts and from its journal."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.studies.directory import PLAN, VARIANTS, StudyDirectory
from fleet2d.studies.journal import read_journal
from fleet2d.studies.parts import VARIANT, Part, read_results, results_table

if TYPE_CHECKING:
    import pyarrow as pa

_STATE = b"fleet2d.parts"
_IN_PLAN = ("identity", "scenario", "template", "home_key")  # columns of the plan that aren't shown
MISSING = "missing"


@dataclass(frozen=True)
class Counts:
    """How far a study is.

    Attributes:
        total: Its variants.
        complete: How many have run.
        failed: How many failed.
    """

    total: int
    complete: int
    failed: int

    @property
    def missing(self) -> int:
        """How many have not run."""
        return self.total - self.complete - self.failed


def statuses(directory: StudyDirectory, parts: Iterable[Part]) -> dict[int, str]:
    """Return how each variant with results ended: the newest result counts."""
    known = tuple(parts)
    found: dict[int, str] = {}
    for table in read_results(directory.storage, known):
        found |= zip(
            table.column(VARIANT).to_pylist(), table.column("status").to_pylist(), strict=True
        )
    for record in read_journal(directory.journal_path(known)):
        found[record.number] = record.header["status"]
    return found


def count(directory: StudyDirectory) -> Counts:
    """Return how far a study is."""
    numbers = directory.read_table(PLAN, [VARIANT]).column(VARIANT).to_pylist()
    ended = statuses(directory, directory.parts())
    states = [ended.get(number, MISSING) for number in numbers]
    return Counts(len(states), states.count("complete"), states.count("failed"))


def assemble(directory: StudyDirectory) -> "pa.Table":
    """Return `variants`: parameters, status, time, digest and metrics, in the design's order."""
    import pyarrow as pa

    parts = directory.parts()
    headers = [record.header for record in read_journal(directory.journal_path(parts))]
    results = list(read_results(directory.storage, parts))
    if headers or not results:
        results.append(results_table(headers))
    joined = pa.concat_tables(results, promote_options="default")
    plan = directory.read_table(PLAN)
    rows = _newest_rows(joined.column(VARIANT).to_numpy(), plan.column(VARIANT).to_numpy())
    matched = joined.take(pa.array(rows, pa.int64(), mask=rows < 0))
    columns = {name: plan.column(name) for name in plan.column_names if name not in _IN_PLAN}
    for name in joined.column_names:
        if name != VARIANT:
            columns[name] = matched.column(name)
    columns["status"] = columns["status"].fill_null(MISSING)
    table = pa.table(columns)
    return table.replace_schema_metadata({_STATE: _state(parts, bool(headers))})


def variants_table(directory: StudyDirectory) -> "pa.Table":
    """Return `variants`, from its file if that is current."""
    parts = directory.parts()
    has_journal = next(read_journal(directory.journal_path(parts)), None) is not None
    if not has_journal:
        try:
            table = directory.read_table(VARIANTS)
        except FileNotFoundError:
            return assemble(directory)
        if (table.schema.metadata or {}).get(_STATE) == _state(parts, has_journal=False):
            return table
    return assemble(directory)


def write_variants(directory: StudyDirectory) -> None:
    """Write `variants.parquet`."""
    directory.write_table(VARIANTS, assemble(directory))


def _newest_rows(numbers: Any, wanted: Any) -> Any:
    """Return for each wanted number its last row, -1 where there is none."""
    last = np.full(max(numbers.max(initial=-1), wanted.max(initial=-1)) + 2, -1, np.int64)
    last[numbers] = np.arange(len(numbers))
    return last[wanted]


def _state(parts: Iterable[Part], has_journal: bool) -> bytes:
    sizes = [[part.number, *(file.sha256[:16] for file in part.files)] for part in parts]
    return json.dumps([sizes, has_journal]).encode()
