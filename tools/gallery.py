"""Draws the gallery of the documentation, homes and scenarios with their sources, and its figures.

python -m tools.gallery             # writes docs/gallery.md, all pictures, and their digests
"""

import hashlib
import io
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

import fleet2d
from fleet2d.floorplan.native import native_document

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
IMAGES = DOCS / "images" / "gallery"
DIGESTS = IMAGES / "digests.json"
WIDTH_PX = 1000


@dataclass(frozen=True)
class Piece:
    """A home, or a moment of a scenario, of the gallery.

    Attributes:
        name: The name of its picture.
        title: Its heading.
        about: What one sees.
        source: The home or the scenario, as commands name it; paths start at the repository.
        at: The moment of the scenario that is drawn; None: the home is.
        changes: Changes of the scenario.
    """

    name: str
    title: str
    about: str
    source: str
    at: str | None = None
    changes: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The commands that draw the same."""
        if self.at is None:
            return f"fleet2d show {self.source} --out {self.name}.png"
        changes = [f"'{change}'" for change in self.changes]
        words = " ".join([self.source, *changes, "--seed 4", f"--out {self.name}"])
        return f'fleet2d run {words} && fleet2d show {self.name} --at "{self.at}"'


PIECES = (
    Piece(
        "family_home",
        "The bundled home",
        "Three bedrooms, two bathrooms, an office; furnished by hand.",
        "family_home",
    ),
    Piece(
        "synthetic",
        "A home from a seed",
        "Made up from the number 21, without a file.",
        "synthetic:21",
    ),
    Piece(
        "small_flat", "A flat in HouseExpo's format", "Drawn by hand.", "examples/small_flat.json"
    ),
    Piece(
        "family",
        "A family in the morning",
        "Who works at home, in town, and at school, before they part.",
        "bundled:family",
        "day 1 07:40",
    ),
    Piece(
        "paper",
        "The paper's base scenario",
        "One person, one robot that learns where she is.",
        "bundled:paper",
        "day 1 19:30",
    ),
    Piece(
        "guests",
        "Dinner with a grandmother and a cat",
        "A household plans its meals together.",
        "examples/family.yaml",
        "day 1 18:55",
    ),
    Piece(
        "flatmates",
        "Flatmates",
        "Three who share a flat, here a synthetic one, and keep to seats of their own.",
        "examples/flatmates.yaml",
        "day 1 20:00",
        ("floorplan={type: synthetic, seed: 3, area_m2: 95, furnish: true}",),
    ),
    Piece(
        "grandmother",
        "A call for grandmother",
        "The robot learns when she likes to talk.",
        "examples/grandmother.yaml",
        "day 1 17:00",
    ),
    Piece(
        "medicine",
        "Medicine at eight",
        "A reminder with a deadline, and an expectation about it.",
        "examples/medicine.yaml",
        "day 1 08:05",
    ),
    Piece(
        "behind_the_sofa",
        "Fallen behind the sofa",
        "Who stands is seen over it, who lies there is not.",
        "examples/behind_the_sofa.yaml",
        "day 1 10:02",
    ),
    Piece(
        "smart_home",
        "A smart home",
        "Doors that people open and robots don't, and sensors.",
        "examples/smart_home.yaml",
        "day 1 07:15",
    ),
    Piece(
        "scripted_evening",
        "A scripted evening",
        "People are sent to places, the robot is called, devices fail.",
        "examples/scripted_evening.yaml",
        "day 1 19:00",
    ),
    Piece(
        "night_patrol",
        "Rounds at night",
        "A scenario that extends another one, in a synthetic home with the outline of an L.",
        "examples/night_patrol.yaml",
        "day 1 23:30",
        ("floorplan={type: synthetic, seed: 11, area_m2: 130, outline: L, furnish: true}",),
    ),
    Piece(
        "meander",
        "Random walks",
        "Brownian motion of a person and two robots, as in the paper.",
        "examples/meander.yaml",
        "day 1 12:00",
    ),
)


# Figures of pages: the scenario, changes of it, and how `fleet2d show` draws it.
FIGURES = {
    "heights": ("examples/behind_the_sofa.yaml", (), ("--at", "day 1 10:02")),
    "people_occlude": ("examples/party.yaml", (), ("--at", "day 1 11:25")),
    "time_since_seen": (
        "bundled:paper",
        ("simulation.duration=1 d", "floorplan.layers={time_since_seen: {}}"),
        ("--layer", "time_since_seen.astro"),
    ),
}
FOV = ("--fov", "11.2,4.2,100,6,108")


def main() -> None:
    """Draw all pieces and figures, and write the page and the digests."""
    IMAGES.mkdir(exist_ok=True)
    digests = {}
    for piece in PIECES:
        shown = open_piece(piece)
        digests[piece.name] = digest_of(shown)
        save(fleet2d.draw(shown, at=piece.at), IMAGES / f"{piece.name}.webp")
    with tempfile.TemporaryDirectory() as folder:
        for name, (_, _, options) in FIGURES.items():
            digests[name] = run_figure(name, Path(folder, name)).digest
            show(str(Path(folder, name)), *options, name=name)
    show(*FOV, name="fov_methods")
    DIGESTS.write_text(json.dumps(digests, indent=2) + "\n", encoding="utf-8")
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")


def run_figure(name: str, out: Path | None = None) -> fleet2d.Run:
    """Return the run that a figure shows."""
    source, changes, _ = FIGURES[name]
    scenario = str(ROOT / source) if source.startswith("examples/") else source
    return fleet2d.run(scenario, *changes, seed=4, out=out)


def show(*words: str, name: str) -> None:
    """Draw a figure by `fleet2d show`."""
    out = str(DOCS / "images" / f"{name}.png")
    command = [sys.executable, "-m", "fleet2d", "show", *words, "--out", out]
    subprocess.run(command, check=True)  # noqa: S603 - its words are those above


def open_piece(piece: Piece) -> Any:
    """Return the home of a piece, or a run of its scenario's first day."""
    source = str(ROOT / piece.source) if piece.source.startswith("examples/") else piece.source
    if piece.at is None:
        return fleet2d.load_floorplan(source)
    scenario = fleet2d.load_scenario(source)
    days = scenario.simulation.duration.total_seconds() / 86400
    changes = [*piece.changes, *(["simulation.duration=1 d"] if days > 1 else [])]
    return fleet2d.run(source, *changes, seed=4)


def digest_of(shown: Any) -> str:
    """Return the digest of a run, or of a home."""
    if isinstance(shown, fleet2d.Run):
        return shown.digest
    content = json.dumps(native_document(shown), sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


def save(figure: Any, path: Path) -> None:
    """Write a figure as a small picture."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=WIDTH_PX / figure.get_size_inches()[0])
    Image.open(buffer).convert("RGB").save(path, quality=70)


def page() -> str:
    """Return the page of the gallery."""
    lines = ["<!-- gallery: made by tools/gallery.py -->", "", "# Gallery", ""]
    for piece in PIECES:
        lines += [f"## {piece.title}", "", piece.about, ""]
        lines += [f"![{piece.title}](images/gallery/{piece.name}.webp)", ""]
        lines += ["```sh", piece.command, "```", ""]
        if piece.source.startswith("examples/"):
            lines += [f"Source: [{piece.source}](../{piece.source}).", ""]
    return "\n".join([*lines, "<!-- end of gallery -->", ""])


if __name__ == "__main__":
    main()
