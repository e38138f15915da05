"""Every bound on time and memory, measured: what it is now beside must, aim and what it was before.

    python benchmarks/bounds.py [NAMES…] [--page docs/results/speed.md]

The bounds are in `bounds.toml`. Each is measured in a process of its own. Times are of the
processor, least of several, so that other work on the machine counts little. `--page` writes the
table to a page of the docs. The exit code is 1 if a must isn't kept.
"""

import argparse
import importlib.metadata
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
DATA = Path(os.environ.get("FLEET2D_SHARED_DATA", HERE.parent.parent / "shared" / "data"))
PAGE = """# How fast

Made by `python benchmarks/bounds.py --page docs/results/speed.md` from
[bounds.toml](../benchmarks/bounds.toml): every bound that the project sets itself, and what was
measured on {machine}. A measured value in bold misses `must`, which a release keeps; it
should get to `aim`. `before` is the version whose kernels Numba compiled. A dash stands for what
wasn't measured.

Seconds are of the processor, least of several, with one thread for linear algebra, as the command
line sets it.

| | measured | must | aim | before |
| --- | --- | --- | --- | --- |
{rows}

What takes longer, or needs a fresh machine, is measured by a command of its own. Its seconds are
wall time, on a machine that does nothing else:

| | measured | must | aim | before | command |
| --- | --- | --- | --- | --- | --- |
{others}
"""


@dataclass(frozen=True)
class Bound:
    """A bound: what is measured, and what it must be and should be.

    What `code` doesn't measure here is measured by `command`, which printed `figure`.
    """

    name: str
    what: str
    unit: str
    must: float
    aim: float
    last: float | None = None
    most: bool = False
    code: str | None = None
    command: str | None = None
    figure: float | None = None

    def verdict(self, figure: float | None) -> str:
        """Say how a figure does."""
        if figure is None:
            return ""
        kept, reached = (
            figure >= bound if self.most else figure <= bound for bound in (self.must, self.aim)
        )
        return "aim" if reached else "must" if kept else "MISSED"

    def row(self, figure: float | None) -> tuple[str, ...]:
        """Return measured, must, aim and last, to be shown."""
        numbers = (figure, self.must, self.aim, self.last)
        return tuple("–" if n is None else f"{_short(n)} {self.unit}" for n in numbers)

    def cells(self, figure: float | None) -> str:
        """Return what it is and its row for the page; a figure that misses its must is bold."""
        measured, *others = self.row(figure)
        if self.verdict(figure) == "MISSED":
            measured = f"**{measured}**"
        return " | ".join((self.what, measured, *others))


def _short(number: float) -> str:
    """Write a number with three digits at least: `0.593`, `1,218`."""
    return f"{number:,.0f}" if number >= 1000 else f"{number:.3g}"


def bounds() -> list[Bound]:
    """Return the bounds, in the order of the file."""
    with (HERE / "bounds.toml").open("rb") as file:
        return [Bound(**bound) for bound in tomllib.load(file)["bound"]]


# --- What the code of a bound may use ----------------------------------------------------------


def least(do: Callable[[], object], times: int, *, imported: bool = False) -> float:
    """Return the processor time of a call [s], least of several.

    With `imported` a scenario is read first, so that loading modules isn't counted.
    """
    if imported:
        from fleet2d.scenario.load import load_scenario

        load_scenario("bundled:paper")
    found = []
    for _ in range(times):
        began = time.process_time()
        do()
        found.append(time.process_time() - began)
    return min(found)


def least_of_both(
    first: Callable[[], object], second: Callable[[], object], times: int
) -> tuple[float, float]:
    """Return the processor times of two calls [s], in turn, each the least of several."""
    pairs = [(least(first, 1), least(second, 1)) for _ in range(times)]
    return min(one for one, _ in pairs), min(other for _, other in pairs)


def run(*overrides: str, **settings: Any) -> object:
    """Run the paper's scenario."""
    import fleet2d

    return fleet2d.run("bundled:paper", *overrides, **settings)


def robots(count: int) -> list[str]:
    """Return overrides that add robots like the first, up to a number."""
    return _copies("robots", "astro", count)


def rounds(count: int) -> list[str]:
    """Return overrides of so many robots that go from room to room, each in its own order."""
    names = ["astro", *(f"astro_{i}" for i in range(1, count))]
    order = "[{type: patrol, dwell: 10 min, order: random}]"
    return [*robots(count), *(f"robots.{name}.behaviors={order}" for name in names)]


def cost_of_yielding(*overrides: str) -> float:
    """Return how many times longer a run takes with bodies that yield than with ghosts."""

    def run_as(ghosts: str) -> Callable[[], object]:
        return lambda: run(f"simulation.ghosts={ghosts}", *overrides, seed=4)

    run_as("true")()
    ghosts, yielding = least_of_both(run_as("true"), run_as("false"), 3)
    return yielding / ghosts


def users(count: int) -> list[str]:
    """Return overrides that add users like the first, up to a number."""
    import fleet2d

    first = next(
        iter(fleet2d.Simulation("bundled:paper", "simulation.duration=1 h").scenario.users)
    )
    return _copies("users", first, count)


def requests(behavior: str) -> list[str]:
    """Return overrides of ten requests a day to one person, which a behavior serves."""
    return [
        f"robots.astro.behaviors=[{behavior}, {{type: patrol, dwell: 0 s, cooldown: 4 h}},"
        " {type: hangout, source: ltp, near: view, period: 1 h, explore: 20 %,"
        " no_stops_in: [bathroom]}]",
        "interactions={pill: {do: remind, to: ana, at: ['08:00', '20:00'], within: 1 h, worth: 5},"
        " music: {do: offer, to: ana, at: ['10:00', '12:00', '14:00', '16:00'], within: 1 h,"
        " worth: 3},"
        " hello: {do: greet, to: ana, at: ['09:00', '11:00', '18:00', '21:00'], within: 1 h}}",
    ]


def _copies(bucket: str, name: str, count: int) -> list[str]:
    import fleet2d

    content = fleet2d.Simulation("bundled:paper", "simulation.duration=1 h").scenario.resolved()
    one = json.dumps(content[bucket][name])
    return [f"{bucket}.{name}_{i}={one}" for i in range(1, count)]


def folder() -> str:
    """Return the name of a directory for a run."""
    return str(Path(tempfile.mkdtemp()) / "run")


def python(code: str) -> float:
    """Return the processor time of a Python process [s]."""
    return _process(["-c", code])


def command(*arguments: str) -> float:
    """Return the processor time of a command of Fleet2D [s]."""
    return _process(["-m", "fleet2d.cli", *arguments])


def _process(arguments: Sequence[str]) -> float:
    def spent() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    began = spent()
    # With bytecode written, as it is for everybody who installs Fleet2D.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run(
        [sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment
    )
    return spent() - began


def peak_gb() -> float:
    """Return the most memory that this process had [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def installed_mb(name: str) -> float:
    """Return the size of the installed dependencies of a package, those of extras left out [MB]."""
    names, pending = set(), [name]
    while pending:
        for requirement in importlib.metadata.requires(pending.pop()) or []:
            package = re.match(r"[\w.-]+", requirement)
            if package is None or "extra ==" in requirement or "platform_system" in requirement:
                continue
            if package[0] not in names:
                names.add(package[0])
                pending.append(package[0])
    files = [Path(str(f.locate())) for n in names for f in importlib.metadata.files(n) or []]
    return sum(file.stat().st_size for file in files if file.exists()) / 1e6


def regions_of(name: str) -> float | None:
    """Return how long the regions of all free cells of a plan take [s]; None without the file."""
    import numpy as np

    import fleet2d
    from fleet2d.kernels import rasterize_cells, regions_of_cells

    found = sorted((DATA / "houseexpo").glob(f"{name}*.json"))
    if not found:
        return None
    plan = fleet2d.load_floorplan(found[0])
    triangles = rasterize_cells(plan.mesh, plan.lattice.rows, plan.lattice.columns)
    cells = np.argwhere(triangles >= 0)
    return least(lambda: regions_of_cells(plan.mesh, cells, triangles), 5)


# --- Measuring ---------------------------------------------------------------------------------


def measure(bound: Bound) -> float | None:
    """Return the figure of a bound, measured in a process of its own; None without its data."""
    assert bound.code is not None
    done = subprocess.run(
        [sys.executable, __file__, "--code", bound.code],
        check=True,
        capture_output=True,
        text=True,
        env={"OPENBLAS_NUM_THREADS": "1", **os.environ},
    )
    figure: float | None = json.loads(done.stdout.splitlines()[-1])
    return figure


def run_code(code: str) -> None:
    """Run the code of a bound, and print the figure that it sets."""
    import statistics

    import fleet2d

    names = {**globals(), "fleet2d": fleet2d, "statistics": statistics}
    exec(code, names)
    print(json.dumps(names["figure"]))


def machine() -> str:
    """Name the processor and the number of cores."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    model = next((line.partition(":")[2].strip() for line in lines if "model name" in line), "")
    return f"{os.cpu_count()} cores{f' of {model}' if model else ''}"


def main() -> int:
    """Measure, print the table, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", help="which bounds; left out: all")
    parser.add_argument("--page", type=Path, help="write the table to this page, too")
    parser.add_argument("--code", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.code is not None:
        run_code(options.code)
        return 0
    known = bounds()
    unknown = set(options.names) - {bound.name for bound in known}
    if unknown:
        parser.error(
            f"no bound {sorted(unknown)[0]!r}; there are: {', '.join(b.name for b in known)}"
        )
    print(f"{'':<20}{'measured':>12}{'must':>12}{'aim':>12}{'last':>12}")
    rows, others, missed = [], [], False
    for bound in known:
        if bound.command:
            others.append(f"| {bound.cells(bound.figure)} | `{bound.command}` |")
            continue
        asked = not options.names or bound.name in options.names
        figure = measure(bound) if asked else None
        if asked:
            cells = "".join(f"{cell:>12}" for cell in bound.row(figure))
            print(f"{bound.name:<20}{cells}  {bound.verdict(figure)}", flush=True)
        missed = missed or bound.verdict(figure) == "MISSED"
        rows.append(f"| {bound.cells(figure)} |")
    if options.page:
        options.page.write_text(
            PAGE.format(machine=machine(), rows="\n".join(rows), others="\n".join(others))
        )
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
