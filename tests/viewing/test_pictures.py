"""Every view of the page looks as it did when somebody looked at it, light and dark.

`FLEET2D_WRITE_PICTURES=1 pytest tests/viewing/test_pictures.py` stores the present pictures, of all
views with `FLEET2D_THOROUGH=1`: look at each before it is committed.
"""

import io
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.thorough import THOROUGH

from fleet2d.viewing.page_server import PageServer

from .browser import page_at

PICTURES = Path(__file__).parent / "screenshots"
SIZE = {"width": 1000, "height": 720}
SMALLER = 4  # pixels are averaged: fonts differ a little between machines
MEAN, LARGE, SHARE = 4.0, 48, 0.02  # of 255: mean difference; share of pixels with a large one
AT = "at=2026-01-05T07:20:00"
VIEWS = {
    "now": f"#{AT}&panel=now",
    "day": f"#{AT}&from=2026-01-05T06:00:00&to=2026-01-05T09:00:00&panel=inspect&select=astro",
    "beliefs": f"#{AT}&panel=beliefs&show=names,beliefs",
    "events": f"#{AT}&panel=events&kind=activity",
    "metrics": f"#{AT}&panel=metrics",
    "layers": f"#{AT}&panel=layers&layer=dust",
    "notes": f"#{AT}&panel=notes&body=ana",
    "two": f"#{AT}&panel=now",
}
ORDINARY = [("now", "light"), ("beliefs", "dark")]


@pytest.fixture(scope="module")
def addresses(run_dir, other_dir):
    servers = {"two": PageServer([run_dir, other_dir]), "": PageServer([run_dir])}
    stops = [server.start() for server in servers.values()]
    yield {name: server.address for name, server in servers.items()}
    for stop in stops:
        stop()


def picture_of(page):
    with Image.open(io.BytesIO(page.screenshot())) as image:
        small = image.convert("RGB").resize(
            (SIZE["width"] // SMALLER, SIZE["height"] // SMALLER), Image.Resampling.BOX
        )
        return np.asarray(small)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("view", "scheme"),
    [
        (view, scheme)
        for view in VIEWS
        for scheme in ("light", "dark")
        if THOROUGH or (view, scheme) in ORDINARY
    ],
)
def test_view_looks_as_before(browser, addresses, view, scheme):
    address = addresses.get(view, addresses[""]) + VIEWS[view]
    with page_at(browser, address, color_scheme=scheme, viewport=SIZE) as page:
        page.wait_for_timeout(1200)
        seen = picture_of(page)
    path = PICTURES / f"{view}_{scheme}.png"
    if os.environ.get("FLEET2D_WRITE_PICTURES") == "1":
        Image.fromarray(seen).save(path, optimize=True)
    with Image.open(path) as image:
        stored = np.asarray(image.convert("RGB"))
    difference = np.abs(seen.astype(int) - stored.astype(int)).max(axis=2)
    assert difference.mean() < MEAN
    assert (difference > LARGE).mean() < SHARE
