"""The commands `fleet2d dataset make`, `verify`, `train` and `score`."""

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fleet2d.errors import InputError, printable
from fleet2d.options import Workers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fleet2d.learning.datasets.reader import Dataset
    from fleet2d.learning.datasets.tasks import LeaderboardEntry
    from fleet2d.learning.datasets.windows import Windows

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="A data set.")]
making = typer.Typer(
    help="Make labelled data sets; train and score models on them.\n\nExamples:\n"
    "  fleet2d dataset make presence.yaml --out presence\n"
    "  fleet2d dataset train --on presence --out rtp.npz\n"
    "  fleet2d dataset score presence --task rtp",
    no_args_is_help=True,
)


@making.command()
def make(
    source: Annotated[Path, typer.Argument(metavar="FILE.yaml", help="What it is drawn from.")],
    out: Annotated[Path, typer.Option(help="The folder to write.")],
    workers: Workers = None,
) -> None:
    """Make a data set, or what an interrupted one lacks.

    Examples:
      fleet2d dataset make presence.yaml --out presence
    """
    _make(source, out, workers)


@making.command()
def verify(directory: Folder) -> None:
    """Compare the files of a data set with its manifest.

    Examples:
      fleet2d dataset verify presence
    """
    from fleet2d.learning.datasets.reader import open_dataset

    made = open_dataset(directory)
    differing = made.verify()
    for name in differing:
        typer.echo(f"{directory / name} is missing, or differs from what was written", err=True)
    if differing:
        typer.echo(
            "delete these files, and make them again: fleet2d dataset make FILE.yaml --out"
            f" {directory}",
            err=True,
        )
        raise typer.Exit(1)
    _print_size(made)


def _make(source: Path, out: Path, workers: int | None) -> None:
    """Make a data set, or the files that it lacks."""
    from fleet2d.learning.datasets.generate import dataset as make

    _print_size(make(source, out, workers=workers))


def _print_size(made: "Dataset") -> None:
    size = sum(file.bytes for file in made.manifest.files.values())
    runs = ", ".join(f"{name} {count}" for name, count in made.manifest.splits.items())
    typer.echo(f"{made.root}: {runs} runs, {size / 1e6:.2f} MB")


@making.command("train")
def train_network(
    on: Annotated[
        Path,
        typer.Option(
            metavar="PATH", help="A data set, the YAML file of one, which is made, or a stored run."
        ),
    ],
    out: Annotated[Path, typer.Option(help="The file of weights to write.")] = Path("learned.npz"),
    start: Annotated[
        str | None,
        typer.Option("--from", help="Weights to go on from: a file, or `learned`, the shipped."),
    ] = None,
    hidden: Annotated[int, typer.Option(min=1, max=256, help="Width of the layers.")] = 32,
    epochs: Annotated[int, typer.Option(min=1, help="How often each window is used.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Of the first weights.")] = 0,
) -> None:
    """Train the network of `learned` on a data set or a run.

    The data set of a YAML file is made beside the weights, once: learned_data for learned.npz. If a
    data set has a split `test`, the weights are scored on it in the end, beside the shipped ones.
    It needs PyTorch: pip install "fleet2d[ml]".

    Examples:
      fleet2d dataset train --on presence --out rtp.npz
      fleet2d dataset train --on runs/home-001 --from learned
    """
    from fleet2d.algorithms.presence.learned import Weights, shipped_weights
    from fleet2d.learning.datasets.reader import MANIFEST, open_dataset
    from fleet2d.learning.datasets.tasks import Networks
    from fleet2d.learning.datasets.tasks import leaderboard as score
    from fleet2d.learning.datasets.training import TrainingSettings, fine_tune, train

    if not out.absolute().parent.is_dir():
        raise InputError(f"--out {out}: there is no folder {out.absolute().parent}")
    if on.is_file():
        file = on
        on = out.with_name(f"{out.stem}_data")
        _make(file, on, None)
    began = time.process_time()
    train_on, check_on = _windows(on)
    weights: Weights | None = None
    if start is not None:
        weights = shipped_weights() if start == "learned" else Weights.read(Path(start))
        made = fine_tune(weights, train_on)
    else:
        settings = TrainingSettings(hidden=hidden, epochs=epochs, seed=seed)
        made = train(train_on, check_on, settings, on_epoch=_print_epoch)
    made.save(out)
    count = sum(len(part.truth) for part in train_on)
    typer.echo(f"{out}: {count:,} windows, {time.process_time() - began:.0f} s")
    if (on / MANIFEST).is_file() and "test" in (data := open_dataset(on)).splits:
        _print_scores(score(data, ["rtp"], networks=Networks({out.name: made})), "test")


def _print_epoch(epoch: int, loss: float, checked: float) -> None:
    typer.echo(f"epoch {epoch + 1}: log loss {loss:.3f}, validation {checked:.3f}", err=True)


def _windows(on: Path) -> "tuple[list[Windows], list[Windows]]":
    """Return the windows to train on, and to validate with, of a data set or of a run."""
    from fleet2d.learning.datasets.reader import MANIFEST, open_dataset
    from fleet2d.learning.datasets.tasks import TRAIN, windows
    from fleet2d.learning.datasets.windows import windows_of_run

    if not (on / MANIFEST).is_file() and (on / "manifest.json").is_file():
        from fleet2d.runs.run import open_run

        return windows_of_run(open_run(on)), []
    data = open_dataset(on)
    if TRAIN not in data.splits:
        raise InputError(f"{on} has no split {TRAIN!r}: splits are {', '.join(data.splits)}")
    check = windows(data, "validation") if "validation" in data.splits else ()
    return list(windows(data, TRAIN)), list(check)


@making.command("score")
def leaderboard(
    directory: Folder,
    task: Annotated[
        list[str] | None,
        typer.Option(metavar="TASK", help="A task, several times for more; left out: all."),
    ] = None,
    split: Annotated[str, typer.Option(help="The split to score on.")] = "test",
    weights: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="A file of weights to score, too, for rtp."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            help="Draw how reliable the first network is, or the shipped one; scores nothing."
        ),
    ] = None,
    tune: Annotated[
        int,
        typer.Option(min=0, help="Tune by so many days of each person, and score on later ones."),
    ] = 0,
    gaps: Annotated[
        Path | None,
        typer.Option(help="Draw accuracy and log loss by gap, of all models; scores nothing."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Score baselines and your own networks on a data set.

    Examples:
      fleet2d dataset score presence
      fleet2d dataset score presence --task rtp --weights rtp.npz
    """
    from fleet2d.algorithms.presence.learned import Weights
    from fleet2d.learning.datasets.reader import open_dataset
    from fleet2d.learning.datasets.tasks import Networks, forecasts, measures_by_gap
    from fleet2d.learning.datasets.tasks import leaderboard as score

    models = {path.name: Weights.read(path) for path in weights or []}
    networks = Networks(models, tune)
    if picture is not None or gaps is not None:
        from fleet2d.viewing.pictures.charts import draw_forecasts, draw_gaps

        made = forecasts(open_dataset(directory), split, networks)
        name = [*models, "learned"][0]
        if made is None:
            raise InputError(f"{directory} has no windows in {split!r}: nothing to draw")
        if picture is not None:
            draw_forecasts(name, made.beliefs[name], made.truth, picture)
            typer.echo(f"{picture}: how reliable {name} is")
        if gaps is not None:
            draw_gaps(measures_by_gap(made), gaps)
            typer.echo(f"{gaps}: accuracy and log loss by gap")
        return
    entries = score(open_dataset(directory), task or (), split, networks)
    if as_json:
        rows: list[dict[str, Any]] = [
            {"task": e.task, "model": e.model, "count": e.cases, **e.scores} for e in entries
        ]
        typer.echo(json.dumps({"split": split, "entries": rows}))
        return
    _print_scores(entries, split)


def _print_scores(entries: "Sequence[LeaderboardEntry]", split: str) -> None:
    """Print a table for each task: a line for each metric, a column for each model."""
    from fleet2d.learning.datasets.tasks import LOWER_END, UPPER_END

    def cell(entry: "LeaderboardEntry", metric: str) -> str:
        names = [f"{metric}{end}" for end in (LOWER_END, UPPER_END)]
        ends = [f"{entry.scores[name]:.3f}" for name in names if name in entry.scores]
        interval = f" ({' to '.join(ends)})" if ends else ""
        return f"{entry.scores[metric]:.3f}{interval}"

    for name in dict.fromkeys(entry.task for entry in entries):
        own = [entry for entry in entries if entry.task == name]
        metrics = [m for m in own[0].scores if not m.endswith((LOWER_END, UPPER_END))]
        columns = [["", *map(printable, metrics)]]
        for entry in own:
            cells = [cell(entry, metric) for metric in metrics]
            columns.append([printable(entry.model), *cells])
        first_width, *widths = [max(map(len, column)) for column in columns]
        typer.echo(f"{name} ({own[0].cases:,} cases of {split})")
        for first, *others in zip(*columns, strict=True):
            line = [first.ljust(first_width), *map(str.rjust, others, widths)]
            typer.echo(f"  {'  '.join(line)}")
