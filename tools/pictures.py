"""Redraws all pictures of README, gallery, pages and tutorials, with digests of what they show.

python -m tools.pictures            # some minutes; needs the extra `browser` and Debian's chromium

Those of measurements are drawn by their benchmarks, as the pages of results say.
"""

import io
import json
import subprocess
import sys
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright
from tools import gallery

import fleet2d
from fleet2d.runs.run import Run
from fleet2d.viewing.page_data import PageData
from fleet2d.viewing.page_server import PageServer
from fleet2d.viewing.pictures.run import draw_run

IMAGES = Path(__file__).parents[1] / "docs" / "images"
CHROMIUM = "/usr/bin/chromium"
PAGE = {"width": 1440, "height": 900}  # of the still picture of the page [px]
FILM = {"width": 1368, "height": 1000}  # of a page whose plan is 1,000 pixels wide [px]
FRAMES_PER_S = 10
SHOWN_DAY = 15  # of the month: by then the robot knows who is where at which hours
# What the film shows of the day, and for how many seconds of the film.
SCENES = ((7.2, 8.4, 9), (17.9, 18.9, 8), (21.5, 23.0, 3))
STILL_H = 18.65


def main() -> None:
    """Draw all pictures, and write `digests.json`."""
    gallery.main()
    subprocess.run([sys.executable, "-m", "tools.tutorials"], check=True)
    month = fleet2d.run("bundled:family")
    draw_run(month, IMAGES / "month.png")
    draw_page(month, IMAGES / "page.png")
    film_page(month, IMAGES / "day.webp")
    digests = dict.fromkeys(("day.webp", "month.png", "page.png"), month.digest)
    (IMAGES / "digests.json").write_text(json.dumps(digests, indent=2) + "\n", encoding="utf-8")


def draw_page(run: Run, path: Path) -> None:
    """Write a picture of the page of a run, at an evening."""
    evening = run.clock.start + timedelta(days=SHOWN_DAY - 1, hours=STILL_H)
    (picture,) = pictures_of(run, [f"at={evening:%Y-%m-%dT%H:%M:%S}"], PAGE, "body")
    picture.save(path, optimize=True)


def film_page(run: Run, path: Path) -> None:
    """Write a film of the plan on the page: some scenes of a day."""
    first, *others = pictures_of(run, film_views(run), FILM, ".plans")
    first.save(
        path, save_all=True, append_images=others, duration=1000 // FRAMES_PER_S, loop=0, quality=55
    )


def film_views(run: Run) -> list[str]:
    """Return the view of each frame of the film."""
    midnight = run.clock.start + timedelta(days=SHOWN_DAY - 1)
    moments = []
    for begin_h, end_h, film_s in SCENES:
        frames = film_s * FRAMES_PER_S
        hours = (begin_h + (end_h - begin_h) * i / frames for i in range(frames))
        moments += [midnight + timedelta(hours=hour) for hour in hours]
    return [
        f"at={moment:%Y-%m-%dT%H:%M:%S}&show=names,furniture,sight,lights,ways"
        for moment in moments
    ]


def pictures_of(
    run: Run, views: Sequence[str], size: dict[str, int], part: str
) -> list[Image.Image]:
    """Return pictures of a part of the page of a run, one of each view."""
    server = PageServer([PageData(run)])
    stop = server.start()
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            page: Any = browser.new_page(viewport=size, color_scheme="light")
            page.goto(f"{server.address}#{views[0]}")
            page.wait_for_selector("html[data-ready=true]")
            return [picture_of(page, f"{server.address}#{view}", part) for view in views]
    finally:
        stop()


def picture_of(page: Any, address: str, part: str) -> Image.Image:
    """Return a picture of a part of a page that is open, at another view."""
    page.goto(address)
    page.wait_for_timeout(250)  # two frames, also on a busy machine
    return Image.open(io.BytesIO(page.locator(part).screenshot())).convert("RGB")


if __name__ == "__main__":
    main()
