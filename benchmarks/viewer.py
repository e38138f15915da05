"""How fast runs are watched: opening, scrubbing, memory, a live run, a film.

    python benchmarks/viewer.py [RUN_DIR ...]

Without a run, one of a robot and five users over thirty days is simulated first. Needs Chromium at
/usr/bin/chromium and the extra `test`.
"""

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import fleet2d
from fleet2d.viewer.film import write_film
from fleet2d.viewer.live import LiveRun
from fleet2d.viewer.page_server import PageServer

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.viewer.browser import chromium, page_at

FRAMES = 240
SCRUB = """async (frames) => {
  const box = document.querySelector(".lanes");
  const { left, top, width } = box.getBoundingClientRect();
  box.setPointerCapture = () => {};
  const send = (type, x) => box.dispatchEvent(
    new PointerEvent(type, { clientX: left + x, clientY: top + 60, pointerId: 1, bubbles: true }));
  const times = [];
  let last = performance.now();
  send("pointerdown", 10);
  for (let i = 0; i < frames; i++) {
    send("pointermove", 10 + (width - 20) * i / frames);
    await new Promise(requestAnimationFrame);
    const now = performance.now();
    times.push(now - last);
    last = now;
  }
  send("pointerup", 10);
  return times;
}"""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("runs", nargs="*", type=Path)
    runs = parser.parse_args().runs
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        if not runs:
            people = {name: {"type": "routine"} for name in ("ana", "ben", "cleo", "dan", "eva")}
            runs = [Path(folder) / "month"]
            fleet2d.run("bundled:base", seed=4, users=people, out=runs[0])
        for run in runs:
            measure_page(browser, run)
        measure_live(browser)
        measure_film(runs[0], Path(folder))


def measure_page(browser: Any, run: Path) -> None:
    server = PageServer([run])
    stop = server.start()
    time.sleep(4)  # the server reads the run while the browser starts
    with page_at(browser, server.address) as page:
        marks = "performance.getEntriesByName('first-picture')[0].startTime"
        print(f"{run.name}: first picture after {page.evaluate(marks):.0f} ms")
        for view in ("the whole run", "a day"):
            times = sorted(page.evaluate(SCRUB, FRAMES))
            rate = 1000 / statistics.mean(times)
            slow = times[round(0.95 * FRAMES)]
            print(f"  scrubbing {view}: {rate:.0f} frames/s, 95 % under {slow:.0f} ms")
            page.click("text=Day")
        heap = page.evaluate("performance.memory.totalJSHeapSize / 1e6")
        print(f"  {heap:.0f} MB of heap")
    stop()


def measure_live(browser: Any) -> None:
    live = LiveRun(
        fleet2d.Simulation("bundled:base", "simulation.duration=10 d", seed=4), paused=True
    )
    live.start()
    server = PageServer([], live=live)
    stop = server.start()
    with page_at(browser, server.address) as page:
        page.wait_for_selector(".live[data-paused=true]")
        began = time.perf_counter()
        page.click("button.play")
        page.wait_for_selector("html[data-ended]", timeout=600_000)
        speed = 864_000 / (time.perf_counter() - began)
        print(f"live, a frame a simulated minute: {speed:,.0f} x real time")
    stop()
    live.end()


def measure_film(run: Path, folder: Path) -> None:
    began = time.perf_counter()
    count = write_film(fleet2d.open_run(run), folder / "day.mp4", 86_400, 172_800)
    print(f"film of a day at 60 x: {count} pictures in {time.perf_counter() - began:.1f} s")


if __name__ == "__main__":
    main()
