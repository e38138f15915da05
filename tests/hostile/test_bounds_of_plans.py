"""Pictures and outlines at the bounds: read or refused within 10 s and 1 GB, in a process each."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from tests.homes.formats.test_geojson import feature, line, ring, write
from tests.thorough import THOROUGH

MAX_SECONDS, MAX_MB = 10, 1000
READ = """
import resource, sys, time
from pathlib import Path
import fleet2d
from fleet2d.errors import FloorPlanError
from fleet2d.storage import apart

resolution = 0.05 if sys.argv[1].endswith(".pgm") else None
start = time.process_time()
try:
    plan = fleet2d.load_floorplan(sys.argv[1], resolution=resolution)
    fleet2d.Home(plan).space(0.2)
    answer = f"read: {plan.area_m2:.0f} m2"
except FloorPlanError as error:
    answer = str(error)
seconds = time.process_time() - start
# Not ru_maxrss, which has the memory of the process that this one was forked from.
status = Path('/proc/self/status').read_text()
megabytes = int(status.split('VmHWM:')[1].split()[0]) // 1024
apart._stop(1.0)
child = resource.getrusage(resource.RUSAGE_CHILDREN)
print(seconds + child.ru_utime + child.ru_stime, max(megabytes, child.ru_maxrss // 1024), answer)
"""


def pgm(path, shades):
    rows, columns = shades.shape
    path.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + shades.tobytes())
    return path


def framed(side):
    """Return a white picture within a black line."""
    shades = np.full((side, side), 255, np.uint8)
    shades[[0, -1]] = shades[:, [0, -1]] = 0
    return shades


def white(folder):
    return pgm(folder / "home.pgm", np.full((5000, 5000), 255, np.uint8))


def one_row(folder):
    return pgm(folder / "home.pgm", np.full((1, 1 << 25), 255, np.uint8))


def half_a_row(folder):
    return pgm(folder / "home.pgm", np.full((1, 1 << 24), 255, np.uint8))


def largest_picture(folder):
    return pgm(folder / "home.pgm", framed(4096))


def largest_hall(folder):
    """Write a hall of 10 million pixels in the largest picture."""
    shades = np.full((4096, 4096), 205, np.uint8)
    shades[:3150, :3150] = framed(3150)
    return pgm(folder / "home.pgm", shades)


def combs(folder):
    shades = framed(3150)
    shades[10:-10, ::12] = 0
    return pgm(folder / "home.pgm", shades)


def pillars(folder):
    shades = framed(4096)
    for row in range(4):
        for column in range(4):
            shades[row::30, column::30] = 0
    return pgm(folder / "home.pgm", shades)


def noise(folder):
    shades = framed(4096)
    shades[np.random.default_rng(0).random(shades.shape) > 0.7] = 0
    return pgm(folder / "home.pgm", shades)


def comb_of(teeth):
    """Return the corners of a home of 60 m with thin teeth along a wall."""
    xs = np.linspace(60, 0, 2 * teeth + 1)[1:-1]
    tips = [[round(float(x), 6), 10.0 if k % 2 else 5.0] for k, x in enumerate(xs)]
    return [[0, 0], [60, 0], *tips, [0, 10]]


def room_of(folder, corners):
    return write(folder, feature(ring(*corners), "room"), units="m")


def teeth_at_the_bound(folder):
    return room_of(folder, comb_of(4_800))


def too_many_teeth(folder):
    return room_of(folder, comb_of(60_000))


def most_values(folder):
    angles = np.linspace(0, 2 * np.pi, 990_000, endpoint=False)
    corners = np.round(np.stack([50 * np.cos(angles), 50 * np.sin(angles)], axis=1), 4)
    return room_of(folder, corners.tolist())


def native(folder, *parts):
    path = folder / "home.json"
    path.write_text(json.dumps({"format": "fleet2d-floorplan", "version": 1, "free": parts}))
    return path


def largest_square(folder):
    return native(folder, [[0, 0], [157, 0], [157, 157], [0, 157]])


def written(folder, name, package, *parts):
    pytest.importorskip(package)
    path = folder / name
    path.write_text("".join(parts), encoding="utf-8")
    return path


SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
LINE = "  0\nLINE\n  8\nwall\n 10\n0\n 20\n0\n 11\n1\n 21\n1\n"
INSERT = "  0\nINSERT\n  8\nwall\n  2\nB\n 10\n0\n 20\n0\n"
BLOCK = f"  0\nBLOCK\n  8\n0\n  2\nB\n 70\n0\n 10\n0\n 20\n0\n  3\nB\n{LINE * 1000}  0\nENDBLK\n  8\n0\n"


def section(name, text):
    return f"  0\nSECTION\n  2\n{name}\n{text}  0\nENDSEC\n"


def lines_of_dxf(folder):
    return written(
        folder, "many.dxf", "ezdxf", section("ENTITIES", LINE * 700_000), "  0\nEOF\n"
    )  # fmt: skip


def inserts_of_dxf(folder):
    entities = section("ENTITIES", INSERT * 100_000)
    parts = (section("BLOCKS", BLOCK), entities, "  0\nEOF\n")
    return written(folder, "13-inserts.dxf", "ezdxf", *parts)


def shapes_of_svg(folder):
    shapes = '<rect class="wall" width="9" height="9"/>' * 400_000
    return written(folder, "many.svg", "svgelements", SVG, shapes, "</svg>")


def uses_of_svg(folder):
    groups = ['<g id="a0"><rect class="wall" width="1" height="1"/></g>']
    for number in range(1, 8):
        copies = f'<use xlink:href="#a{number - 1}"/>' * 10
        groups.append(f'<g id="a{number}">{copies}</g>')
    parts = (SVG, "<defs>", *groups, '</defs><use xlink:href="#a7"/></svg>')
    return written(folder, "07-use.svg", "svgelements", *parts)


def walls_of_sweet_home(folder):
    wall = '<wall xStart="0" yStart="0" xEnd="100" yEnd="0" thickness="7"/>'
    return written(folder, "wide.xml", "shapely", "<home>", wall * 800_000, "</home>")


def crossing_walls(folder):
    """Write lines of walls, each of which crosses a quarter of the others."""
    ends = np.random.default_rng(0).random((2_400, 2, 2)).round(4) * 60
    walls = [feature(line(*each), "wall") for each in ends.tolist()]
    return write(folder, *walls, units="m")


def crossing_parts(folder):
    """Write free space of thin parts, each of which crosses a quarter of the others."""
    ends = np.random.default_rng(0).random((2_500, 2, 2)).round(4) * 60
    return native(folder, *([a, b, [b[0] + 0.02, b[1] + 0.02]] for a, b in ends.tolist()))


def too_large_a_square(folder):
    return native(folder, [[0, 0], [223, 0], [223, 223], [0, 223]])


def most_teeth(folder):
    return native(folder, comb_of(12_490))


def parts_and_teeth(folder):
    """Write a file that is small, with as many crossing parts and teeth as are read."""
    corners = [[x, y + 60] for x, y in comb_of(1_500)]
    ends = np.random.default_rng(0).random((140, 2, 2)).round(2) * 60
    return native(folder, corners, *([a, b, [b[0] + 0.2, b[1] + 0.2]] for a, b in ends.tolist()))


def too_many_boxes(folder):
    boxes = np.random.default_rng(0).random((4_900, 4)).round(3) * 60
    square = [[0, 0], [60, 0], [60, 60], [0, 60]]
    path = folder / "home.json"
    path.write_text(json.dumps({"verts": square, "room_category": {"Kitchen": boxes.tolist()}}))
    return path


SLOW = "(READ_SECONDS|READ_MB|CORNERS|POLYGONS)"
ATTACKS = [
    (uses_of_svg, SLOW),
    (inserts_of_dxf, SLOW),
    (lines_of_dxf, SLOW),
    (shapes_of_svg, SLOW),
    (walls_of_sweet_home, SLOW),
    (crossing_walls, SLOW),
    (crossing_parts, "FLEET2D_MAX_CROSSINGS"),
    (too_many_boxes, "FLEET2D_MAX_ROOMS"),
    (white, "FLEET2D_MAX_PIXELS"),
    (too_many_teeth, "FLEET2D_MAX_CORNERS"),
    (one_row, "FLEET2D_MAX_PIXELS"),
    (half_a_row, "at most 32768 a side"),
    (teeth_at_the_bound, "read: "),
    (largest_hall, "read: 24775 m2"),
    (largest_picture, "(17 million cells|READ_SECONDS)"),
    (combs, "read: "),
    (noise, ""),
    (largest_square, "read: 24649 m2"),
    (too_large_a_square, "20 million cells"),
    (most_teeth, "(read: |READ_SECONDS)"),
    (parts_and_teeth, "read: "),
    (most_values, "FLEET2D_MAX_CORNERS"),
    (pillars, "FLEET2D_MAX_CORNERS"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("make", "answer"), ATTACKS if THOROUGH else ATTACKS[:10])
def test_no_plan_takes_long_or_much(tmp_path, make, answer):
    """A white picture took 1.6 GB, one of a single row 2.4 GB, and 60,000 teeth took 27 s."""
    command = [sys.executable, "-c", READ, str(make(tmp_path))]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    seconds, megabytes, reply = run.stdout.split(maxsplit=2)

    assert re.search(answer, reply)
    assert float(seconds) < MAX_SECONDS
    assert int(megabytes) < MAX_MB
