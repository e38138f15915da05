"""How fast runs are watched: opening, scrubbing, questions, memory, a live run, a film.

    python benchmarks/viewer.py [RUN_DIR ...]
    python benchmarks/viewer.py --crowd --year

Without a run, one of a robot and five users over thirty days is simulated first; `--crowd` adds
one of 50 users and 10 robots in 1,049 m² over 14 days, `--year` the paper's over a year. At the
end, what has a limit is printed as a table. Needs Chromium at /usr/bin/chromium and the extra
`test`.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import fleet2d
from fleet2d.viewing.film import write_film
from fleet2d.viewing.live import LiveRun
from fleet2d.viewing.page_server import PageServer

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.viewing.browser import chromium, page_at

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


FIRST_PICTURE = "performance.getEntriesByName('first-picture')[0].startTime"
PLAYED_S = 5
"""How long a run is played to measure its frames."""

COUNT_FRAMES = "window.shown = 0; (function count() { shown++; requestAnimationFrame(count) })()"

ASK = """async (question) => {
  const box = document.getElementById("ask");
  box.value = question;
  box.dispatchEvent(new Event("input", { bubbles: true }));
  const began = performance.now();
  box.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
  await new Promise(requestAnimationFrame);
  return [performance.now() - began, document.getElementById("ask-answer").textContent];
}"""
QUESTIONS = (
    "last seen {user}",
    "nights {user} not in bedroom",
    "{user} in bathroom > 10 min",
    "user seen",
)
ROOMS = (
    ["bedroom"] * 14
    + ["bathroom"] * 5
    + ["living_room", "kitchen", "dining_room"] * 2
    + ["office"] * 3
)


# What is measured of which run: unit, limit, aim.
LIMITS = {
    "month: first picture": ("s", 0.7, 0.4),
    "month: slowest answer": ("ms", 100, 30),
    "month: a frame of the calendar": ("ms", 5, 2),
    "month: a frame of the lanes": ("ms", 5, 2),
    "crowd: a frame of the calendar": ("ms", 14, 8),
    "crowd: a frame of the lanes": ("ms", 14, 8),
    "crowd: first picture": ("s", 1.5, 1),
    "crowd: scrubbing the whole run": ("frames/s", 50, 60),
    "crowd: scrubbing a day": ("frames/s", 50, 60),
    "year: server's memory": ("MB", 300, 150),
    "year: page's heap": ("MB", 100, 60),
    "film of a day at 60 x": ("s", 20, 10),
}
measured: dict[str, float] = {}


def crowd_scenario(folder: Path) -> dict[str, Any]:
    """Return the scenario of 50 users and 10 robots in a home of 1,049 m²: rooms on a corridor."""
    rooms, free = [], [_box(0, 0, 59.35, 2)]
    for number, kind in enumerate(ROOMS):
        left, above = 4.25 * (number // 2), number % 2 == 0
        low = 2.15 if above else -8.22
        area = _box(left, low, left + 4.1, low + 8.07)
        rooms.append({"type": kind, "polygon": area})
        door = 2.0 if above else -0.15
        free += [area, _box(left + 1.5, door, left + 2.4, door + 0.15)]
    plan = folder / "corridor.json"
    content = {"format": "fleet2d-floorplan", "version": 1, "entrance": [0.5, 1.0]}
    rooms.append({"type": "hallway", "polygon": free[0]})
    plan.write_text(
        json.dumps({**content, "free": [{"outline": area} for area in free], "rooms": rooms})
    )
    personas = ("works_outside", "works_from_home", "retired")
    behaviors = [{"type": "patrol", "dwell": "0 s", "cooldown": "4 h"}]
    camera = {"range": [0.3, 4.5], "angle_deg": 108, "detection": 0.95}
    return {
        "simulation": {"start": "2026-01-05", "duration": "14 d", "seed": 4},
        "floorplan": {"type": "native", "path": str(plan), "furnish": True},
        "users": {f"u{i:02d}": {"type": "routine", "persona": personas[i % 3]} for i in range(50)},
        "robots": {f"r{i}": {"camera": camera, "behaviors": behaviors} for i in range(10)},
        "algorithms": {
            "ltp": {"type": "long_term_presence", "estimator": "likelihood", "period": "1 d"}
        },
        "metrics": {"room_share": {}, "sightings": {}},
    }


def _box(left: float, bottom: float, right: float, top: float) -> list[list[float]]:
    return [[left, bottom], [right, bottom], [right, top], [left, top]]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("runs", nargs="*", type=Path)
    parser.add_argument("--crowd", action="store_true")
    parser.add_argument("--year", action="store_true")
    options = parser.parse_args()
    runs = options.runs
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        if not runs:
            people = {name: {"type": "routine"} for name in ("ana", "ben", "cleo", "dan", "eva")}
            runs = [Path(folder) / "month"]
            fleet2d.run("bundled:paper", seed=4, users=people, out=runs[0])
        if options.crowd:
            runs.append(Path(folder) / "crowd")
            fleet2d.run(crowd_scenario(Path(folder)), out=runs[-1])
        if options.year:
            runs.append(Path(folder) / "year")
            fleet2d.run("bundled:paper", "simulation.duration=365 d", seed=4, out=runs[-1])
        for run in runs:
            measure_page(browser, run)
        measure_live(browser)
        measure_film(runs[0], Path(folder))
    print(f"\nload {os.getloadavg()[0]:.1f}{'measured':>33}{'limit':>8}{'aim':>8}")
    for name, (unit, limit, aim) in LIMITS.items():
        if name in measured:
            print(f"{name:32}{measured[name]:8.2f}{limit:8g}{aim:8g} {unit}")


def measure_page(browser: Any, run: Path) -> None:
    """Measure a page; its server is a process of its own, as `fleet2d view` is."""
    began = time.perf_counter()
    server, address = _serve(run)
    with page_at(browser, address):
        lasted = time.perf_counter() - began
        print(f"{run.name}: everything is shown {lasted:.1f} s after the command")
    time.sleep(4)  # the server has read the run: what follows is the page's own time
    with page_at(browser, address) as page:
        first = page.evaluate(FIRST_PICTURE)
        measured[f"{run.name}: first picture"] = first / 1000
        print(f"{run.name}: first picture after {first:.0f} ms")
        for view in ("the whole run", "a day"):
            times = sorted(page.evaluate(SCRUB, FRAMES))
            rate = 1000 / statistics.mean(times)
            slow = times[round(0.95 * FRAMES)]
            measured[f"{run.name}: scrubbing {view}"] = rate
            print(f"  scrubbing {view}: {rate:.0f} frames/s, 95 % under {slow:.0f} ms")
            page.get_by_role("button", name="Day", exact=True).click()
        user = page.locator("tr[data-body]").first.get_attribute("data-body")
        for question in QUESTIONS:
            words = question.format(user=user)
            lasted, answer = page.evaluate(ASK, words)
            slowest = f"{run.name}: slowest answer"
            measured[slowest] = max(lasted, measured.get(slowest, 0.0))
            print(f"  '{words}' ({answer}): {lasted:.0f} ms")
        measure_frames(browser, address, run)
        heap = page.evaluate("performance.memory.usedJSHeapSize / 1e6")
        pages = int(Path(f"/proc/{server.pid}/statm").read_text().split()[1])
        memory = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
        measured[f"{run.name}: page's heap"] = heap
        measured[f"{run.name}: server's memory"] = memory
        print(f"  {heap:.0f} MB of heap; {memory:.0f} MB of the server")
    server.terminate()
    server.wait()


def _serve(run: Path) -> tuple[subprocess.Popen[str], str]:
    """Start the server of a page; return it and its address."""
    program = Path(sys.executable).with_name("fleet2d")
    command = [program, "view", str(run), "--no-browser"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    return server, server.stdout.readline().strip()


def measure_frames(browser: Any, address: str, run: Path) -> None:
    """Measure the processor time of the page's main thread a frame, while a lively hour plays."""
    for view, words in (("calendar", "the calendar"), ("lanes", "the lanes")):
        link = f"{address}#view={view}&at=2026-01-08T07:10:00&speed=60"
        with page_at(browser, link) as page:
            session = page.context.new_cdp_session(page)
            session.send("Performance.enable", {"timeDomain": "threadTicks"})
            page.click("button.play")
            session.send("Runtime.evaluate", {"expression": COUNT_FRAMES})
            work, frames = _work(session), page.evaluate("shown")
            page.wait_for_timeout(1000 * PLAYED_S)
            lasted = _work(session) - work
            milliseconds = 1000 * lasted / max(1, page.evaluate("shown") - frames)
            measured[f"{run.name}: a frame of {words}"] = milliseconds
            print(f"  playing {words}: {milliseconds:.1f} ms of the main thread a frame")


def _work(session: Any) -> float:
    """Return the processor time of the main thread of a page [s]."""
    metrics = session.send("Performance.getMetrics")["metrics"]
    return next(metric["value"] for metric in metrics if metric["name"] == "TaskDuration")


def measure_live(browser: Any) -> None:
    live = LiveRun(
        fleet2d.Simulation("bundled:paper", "simulation.duration=10 d", seed=4), paused=True
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
    began, work = time.perf_counter(), time.process_time()
    count = write_film(fleet2d.open_run(run), folder / "day.mp4", 86_400, 172_800)
    lasted, work = time.perf_counter() - began, time.process_time() - work
    measured["film of a day at 60 x"] = lasted
    print(
        f"film of a day at 60 x: {count} pictures in {lasted:.1f} s, {work:.1f} s of processor time"
    )


if __name__ == "__main__":
    main()
