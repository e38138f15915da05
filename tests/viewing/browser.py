"""A real browser, headless, for the tests of the page."""

import os
from contextlib import contextmanager
from pathlib import Path

import pytest

CHROMIUM = Path("/usr/bin/chromium")
ARGUMENTS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-precise-memory-info",
]  # fmt: skip
READY = "html[data-ready=true], .failure"


@contextmanager
def chromium():
    """Start Chromium, or skip the test with a reason."""
    required = os.environ.get("FLEET2D_REQUIRE_BROWSER") == "1"
    if not CHROMIUM.exists():
        reason = f"there is no {CHROMIUM}: install Debian's package chromium"
        pytest.fail(reason) if required else pytest.skip(reason)
    if not required:
        pytest.importorskip("playwright", reason="playwright is not installed: the extra `browser`")
    from playwright import sync_api

    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        yield browser
        browser.close()


@contextmanager
def page_at(browser, address, ready=READY, **options):
    """Open a page, its lanes and paused if the address doesn't say; fail if it reports an error."""
    context = browser.new_context(**{"viewport": {"width": 1280, "height": 860}, **options})
    page = context.new_page()
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(address if "#" in address else f"{address}#view=lanes&speed=60")
    page.wait_for_selector(ready, timeout=60_000, state="attached")
    yield page
    context.close()
    assert [] == errors, errors
