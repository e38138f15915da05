"""The stored plan of a study: its variants by number, and their scenarios."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from fleet2d.errors import RunDirectoryError
from fleet2d.studies.axes.choice import Label
from fleet2d.studies.data.directory import PLAN, SCENARIOS, StudyDirectory
from fleet2d.studies.data.parts import VARIANT
from fleet2d.studies.plan.study_plan import PlannedVariant, StudyPlan

if TYPE_CHECKING:
    import pyarrow as pa

Changed = Literal["redo", "keep"]
PLAN_COLUMNS = (VARIANT, "identity", "scenario", "template", "home_key", "simulated_s")
BATCH = 1000


class ScenarioFile:
    """Collects the scenarios of combinations as a compressed Parquet file in memory."""

    def __init__(self) -> None:
        """Create an empty file."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._schema = pa.schema([("template", pa.string()), ("scenario", pa.string())])
        self._sink = pa.BufferOutputStream()
        self._writer = pq.ParquetWriter(self._sink, self._schema, compression="zstd")
        self._rows: list[dict[str, str]] = []

    def add(self, template: str, content: Mapping[str, Any]) -> None:
        """Add the scenario of a combination, with any of its seeds."""
        self._rows.append({"template": template, "scenario": json.dumps(content)})
        if len(self._rows) == BATCH:
            self._flush()

    def content(self) -> bytes:
        """Close the file and return its bytes."""
        self._flush()
        self._writer.close()
        return bytes(self._sink.getvalue())

    def _flush(self) -> None:
        import pyarrow as pa

        self._writer.write_table(pa.Table.from_pylist(self._rows, self._schema))
        self._rows = []


@dataclass(frozen=True)
class ReconciledPlan:
    """A plan matched with the stored variants of a study.

    Attributes:
        plan: The plan, with the numbers of stored variants.
        new: The number of variants that the study didn't have.
        set_aside: The number of stored results that no longer belong to it.
    """

    plan: StudyPlan
    new: int
    set_aside: int


def reconcile(
    plan: StudyPlan, directory: StudyDirectory, finished: Iterable[int], changed: Changed | None
) -> ReconciledPlan:
    """Number the variants of a plan as in the stored study; new variants get new numbers.

    Args:
        plan: The current plan.
        directory: The study.
        finished: Numbers of the variants with results.
        changed: What to do with results of other code, inputs or scenarios.

    Raises:
        RunDirectoryError: There are such results, and `changed` is None.
    """
    try:
        stored_rows = directory.read_table(PLAN, PLAN_COLUMNS[:3]).to_pylist()
    except FileNotFoundError:
        return ReconciledPlan(plan, len(plan.variants), 0)
    numbers = {row["identity"]: row[VARIANT] for row in stored_rows}
    present = {variant.identity for variant in plan.variants}
    with_results = set(finished)
    stale = {
        row["scenario"]: row
        for row in stored_rows
        if row["identity"] not in present and row[VARIANT] in with_results
    }
    recomputed = [v for v in plan.variants if v.identity not in numbers and v.scenario in stale]
    if stale and changed is None:
        raise RunDirectoryError(_refusal(directory.location, len(recomputed), len(stale)))
    next_number = max(numbers.values(), default=-1) + 1
    variants: list[PlannedVariant] = []
    reused = 0
    for variant in plan.variants:
        if variant.identity in numbers:
            variants.append(replace(variant, number=numbers[variant.identity]))
        elif changed == "keep" and variant.scenario in stale:
            row = stale[variant.scenario]
            variants.append(replace(variant, number=row[VARIANT], identity=row["identity"]))
            reused += 1
        else:
            variants.append(replace(variant, number=next_number))
            next_number += 1
    new_variants = sum(variant.identity not in numbers for variant in variants)
    return ReconciledPlan(
        StudyPlan(plan.design, tuple(variants)), new_variants, len(stale) - reused
    )


def _refusal(location: str, recomputed: int, stale: int) -> str:
    removed = stale - recomputed
    causes = [
        f"{recomputed} of the same scenarios, by other code or input files" * bool(recomputed),
        f"{removed} of scenarios that the study no longer has" * bool(removed),
    ]
    keep = ", --changed keep leaves those of other code as they are" if recomputed else ""
    return (
        f"{location} holds results that don't belong to this study as it is now:"
        f" {' and '.join(filter(None, causes))}. --changed redo runs anew what has changed and"
        f" sets the old results aside{keep}; or choose another --out"
    )


def plan_table(plan: StudyPlan) -> "pa.Table":
    """Return a plan as a table: a row per variant, in the order of the design."""
    import pyarrow as pa

    columns: dict[str, pa.Array] = {
        VARIANT: pa.array([v.number for v in plan.variants], pa.int32())
    }
    for name in PLAN_COLUMNS[1:]:
        columns[name] = pa.array([getattr(v, name) for v in plan.variants])
    labels = [plan.parameters(v) for v in plan.variants]
    for column in plan.design.columns:
        columns[column] = label_array([row[column] for row in labels])
    return pa.table(columns)


def label_array(labels: list[Label]) -> "pa.Array":
    """Return labels as a column: numbers or booleans if all labels are, else text.

    >>> label_array([1, 2.5]).type, label_array([1, "a"]).to_pylist()
    (DataType(double), ['1', 'a'])
    """
    import pyarrow as pa

    kinds = {type(label) for label in labels if label is not None}
    if kinds <= {bool} or kinds <= {int}:
        return pa.array(labels, pa.bool_() if kinds == {bool} else pa.int64())
    if kinds <= {int, float}:
        return pa.array(labels, pa.float64())
    return pa.array([None if label is None else str(label) for label in labels], pa.string())


def write_catalogue(
    directory: StudyDirectory, plan: StudyPlan, scenarios: Callable[[], bytes]
) -> None:
    """Write the plan and the scenarios of a study."""
    directory.storage.write(SCENARIOS, scenarios())
    directory.write_table(PLAN, plan_table(plan))


def stored_scenario(directory: StudyDirectory, number: int) -> dict[str, Any]:
    """Return the scenario of a variant, with its seed.

    Raises:
        RunDirectoryError: The study has no such variant.
    """
    import pyarrow.parquet as pq

    filesystem, path = directory.storage.filesystem, directory.storage.path
    rows = pq.read_table(
        path(PLAN), filesystem=filesystem, filters=[(VARIANT, "=", number)],
        columns=["template", "seed"],
    ).to_pylist()  # fmt: skip
    if not rows:
        raise RunDirectoryError(f"{directory.location} has no variant {number}")
    texts = pq.read_table(
        path(SCENARIOS), filesystem=filesystem, filters=[("template", "=", rows[0]["template"])]
    ).to_pylist()
    content: dict[str, Any] = json.loads(texts[0]["scenario"])
    content["simulation"]["seed"] = rows[0]["seed"]
    return content
