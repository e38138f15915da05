"""The data card: what a data set holds, how much of it, how it is distributed, and its biases.

It is the README.md of the folder. Its head is what `datasets.load_dataset` reads: a configuration
for each table, with the files of each split.
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from fleet2d.datasets.reader import Dataset
from fleet2d.datasets.specification import DatasetFile
from fleet2d.datasets.tables import SCHEMAS
from fleet2d.storage.files import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CARD, PICTURES = "README.md", "pictures"
MAX_VALUES = 12  # of a distribution in a row
TABLES = {
    "runs": "a row for each run: split, home, household, what was varied, seed, digest",
    "rooms": "a row for each room of the home of a run: kind, area, middle",
    "evidence": "what the robot looked at and perceived, minute by minute; the only table that a"
    " model may read",
    "labels": "where each user truly was, where the user went next and at which step, and what the"
    " user did",
    "beliefs": "the belief of the models of real-time presence that ran along",
}
BIASES = (
    "People are simulated: their days are drawn from personas, and repeat more than those of real"
    " people. Nobody visits.",
    "Homes have the rooms and the furniture that the generator, or the floor plans, know of. People"
    " walk the shortest way.",
    "The robot perceives rooms by line of sight and chance. Identities are right unless the"
    " scenario says otherwise.",
    "Rows of a run depend on each other: split and resample by run, or by home, never by row.",
)


def write_card(data: Dataset, file: DatasetFile) -> None:
    """Write the data card of a data set, with pictures if matplotlib is installed."""
    root = data.root
    counts = {split: _count(data, split) for split in data.splits}
    text = [
        f"---\n{yaml.safe_dump(_head(data, file), sort_keys=False)}---\n",
        f"# {file.name}\n",
        f"{file.description or 'Evidence of robots in homes, and where people were.'} Made by"
        f" Fleet2D; licence {file.licence}.\n",
        "## How much\n",
        _table(
            ["split", "runs", "days", "homes", "labels", "rows of evidence"],
            [
                [s, c["runs"], f"{c['days']:g}", c["homes"], c["labels"], c["evidence"]]
                for s, c in counts.items()
            ],
        ),
        "No home, household or persona is in more than one split: this is checked before the first"
        " run. No two runs have the same seed, so no two have the same days.\n",
        "## Tables\n",
        *(
            f"- `{name}`: {words}. Columns: {', '.join(f'`{c}`' for c in SCHEMAS[name].names)}."
            for name, words in TABLES.items()
        ),
        "\n`step` is the last step that a row knows of: join `evidence` up to a step with `labels`"
        " of that step.\n",
        "## Distributions\n",
        *(_distribution(split, c) for split, c in counts.items()),
        *(f"![{words}]({PICTURES}/{name}.png)\n" for name, words in _draw(root, counts).items()),
        "## Known biases\n",
        *(f"- {bias}" for bias in BIASES),
    ]
    write_atomically(root / CARD, "\n".join(text).encode())


def _head(data: Dataset, file: DatasetFile) -> dict[str, Any]:
    """Return the head of the card, which the Hub and `datasets` read."""
    return {
        "license": file.licence.lower(),
        "pretty_name": file.name,
        "configs": [
            {
                "config_name": table,
                "data_files": [
                    {"split": split, "path": f"{split}/{table}-*.parquet"} for split in data.splits
                ],
                **({"default": True} if table == "labels" else {}),
            }
            for table in SCHEMAS
        ],
    }


def _count(data: Dataset, split: str) -> dict[str, Any]:
    """Return how much there is in a split, and how it is distributed."""
    runs, labels = data.arrow("runs", split), data.arrow("labels", split)
    rooms = {
        (run, room): kind
        for run, room, kind in zip(
            *(data.arrow("rooms", split)[c].to_pylist() for c in ("run", "room", "kind")),
            strict=True,
        )
    }
    places = Counter(zip(labels["run"].to_pylist(), labels["place"].to_pylist(), strict=True))
    kinds: Counter[str] = Counter()
    for place, count in places.items():
        kinds[rooms.get(place, "away")] += count
    return {
        "runs": len(runs),
        "days": sum(runs["days"].to_pylist()),
        "homes": len(set(runs["home"].to_pylist())),
        "labels": len(labels),
        "evidence": sum(
            record["rows"]
            for name, record in data.manifest["files"].items()
            if name.startswith(f"{split}/evidence-")
        ),
        "household": Counter(runs["household"].to_pylist()),
        "varied": Counter(
            part for text in runs["varied"].to_pylist() for part in text.split("; ") if part
        ),
        "place": kinds,
        "rooms in a home": Counter(str(n) for n in Counter(run for run, _ in rooms).values()),
    }


def _distribution(split: str, counts: Mapping[str, Any]) -> str:
    lines = [f"**{split}**\n"]
    for name in ("household", "varied", "rooms in a home", "place"):
        total = sum(counts[name].values())
        shares = [
            f"{value} {count / total:.0%}" for value, count in counts[name].most_common(MAX_VALUES)
        ]
        if shares:
            lines.append(f"- {name}: {', '.join(shares)}")
    return "\n".join(lines) + "\n"


def _table(head: list[str], rows: list[list[Any]]) -> str:
    """Return a table in Markdown."""
    cells = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in row)} |" for row in cells) + "\n"


def _draw(root: Path, counts: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Draw where people are, by split; return captions by name, none without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return {}
    folder = root / PICTURES
    folder.mkdir(exist_ok=True)
    captions = {}
    for name, words in (
        ("place", "Share of time in each kind of room, and away, by split"),
        ("rooms in a home", "Rooms of the homes, by split"),
    ):
        figure = _bars(Figure(figsize=(8, 3.2), layout="constrained"), counts, name)
        slug = name.replace(" ", "_")
        figure.savefig(folder / f"{slug}.png", dpi=110, metadata={"Software": None})
        captions[slug] = words
    return captions


def _bars(figure: "Figure", counts: Mapping[str, Mapping[str, Any]], name: str) -> "Figure":
    from fleet2d.palette import USER_COLORS

    axes = figure.subplots()
    total: Counter[str] = sum((Counter(c[name]) for c in counts.values()), Counter())
    keys = [key for key, _ in total.most_common(MAX_VALUES)]
    if all(key.isdigit() for key in keys):
        keys.sort(key=int)
    width = 0.8 / len(counts)
    for k, (split, own) in enumerate(counts.items()):
        share = [own[name][key] / max(sum(own[name].values()), 1) for key in keys]
        at = [i + (k - (len(counts) - 1) / 2) * width for i in range(len(keys))]
        axes.bar(at, share, width, label=split, color=USER_COLORS[k % len(USER_COLORS)])
    axes.set_xticks(range(len(keys)), keys, rotation=30 if name == "place" else 0, ha="right")
    axes.set_ylabel("share")
    axes.set_xlabel(name)
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    return figure
