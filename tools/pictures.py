"""Redraws the README's pictures from the bundled family, with the digests of the runs they show.

python tools/pictures.py            # a minute or two
"""

import json
from pathlib import Path

import fleet2d
from fleet2d.viewing.film import write_film
from fleet2d.viewing.pictures.run import draw_run

IMAGES = Path(__file__).parents[1] / "docs" / "images"
DAY = "simulation.duration=1 d"
FILM_S = 20
WIDE_PX = 820  # the height at which a film of the bundled home is 1,000 pixels wide
HOURS = (6, 23)


def main() -> None:
    """Draw the pictures, and write `digests.json`."""
    month = fleet2d.run("bundled:family")
    draw_run(month, IMAGES / "month.png")
    day = fleet2d.run("bundled:family", DAY)
    first, end = (hour * 3600 for hour in HOURS)
    speed = (end - first) / FILM_S
    write_film(day, IMAGES / "day.webp", first, end, speed=speed, height=WIDE_PX, frames_per_s=10)
    digests = {"day.webp": day.digest, "month.png": month.digest}
    (IMAGES / "digests.json").write_text(json.dumps(digests, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
