"""Every reader: files that are right, how they are changed, and how they are read."""

import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from hypothesis import strategies as st
from tests.fuzz.changes import lines, pieces, structures
from tests.homes.test_damaged_files import FORMATS, PGM
from tests.logs.test_layout_reading import ADLS, CASAS, HOMER, SENSORS
from tests.logs.test_layouts import EVENTS, HISTORY, KASTEREN, MIT, OPENSHS, STATES
from tests.scenes import flat_document, scenario

import fleet2d
from fleet2d.algorithms.algorithm import load_learned
from fleet2d.artifacts.verification import verify_run
from fleet2d.configuration.trust import running_code
from fleet2d.floorplan.load import load_floorplan
from fleet2d.learning.fit.perception import read_detections
from fleet2d.live.messages import parse_message
from fleet2d.logs.layout import read_log
from fleet2d.routines.persona import BUNDLED as PERSONAS
from fleet2d.scenario.load import load_scenario
from fleet2d.studies.specification import read_specification

RUN = Path(__file__).parents[1] / "fixtures" / "run"


@dataclass(frozen=True)
class Reader:
    """A reader and its inputs.

    Attributes:
        name: What it reads.
        file: What the file is called.
        contents: Contents of the file that are nearly right.
        read: Reads the file; what is wrong is a `Fleet2DError`.
        beside: Puts other files into the folder before.
        cost: How many times as long as others it takes.
    """

    name: str
    file: str
    contents: Callable[[], st.SearchStrategy[bytes]]
    read: Callable[[Path], Any]
    beside: Callable[[Path], Any] = lambda _: None
    cost: int = 1


def _yaml(*seeds):
    texts = [yaml.safe_dump(seed, sort_keys=False).encode() for seed in seeds]
    changed = st.one_of(*map(structures, seeds)).map(_dumped)
    return st.one_of(changed, changed, *map(pieces, texts))


def _dumped(content):
    try:
        return yaml.safe_dump(content, sort_keys=False, allow_unicode=True).encode(
            "utf-8", "replace"
        )
    except ValueError:  # a number of too many digits for Python to write
        return b"{}"


def _json(*seeds):
    texts = [json.dumps(seed).encode() for seed in seeds]
    changed = st.one_of(*map(structures, seeds)).map(lambda c: json.dumps(c).encode())
    return st.one_of(changed, changed, *map(pieces, texts))


# --- Scenarios ---------------------------------------------------------------------------------


def _scenario():
    days = [{"on": "weekdays", "items": [{"at": "07:00", "place": "kitchen", "dwell": "20 min"}]}]
    content = scenario(
        "1 h",
        users={
            "ana": {"type": "routine", "persona": "works_from_home"},
            "ben": {"type": "schedule", "days": days},
            "cid": {"behaviors": [{"type": "room_sampling"}, {"type": "meander"}]},
        },
        robots={
            "astro": {
                "camera": {"range": [0.3, 4.5], "angle_deg": 108, "detection": "95 %"},
                "behaviors": [{"type": "hangout", "source": "ltp"}, {"type": "patrol"}],
            }
        },
        objects={"door": {"type": "motion_sensor", "at": [2, 1], "range": "4 m"}},
        algorithms={"ltp": {"type": "long_term_presence", "period": "30 min"}},
        metrics={"sightings": {}, "ltp_error": {"of": "ltp"}},
        script=[{"at": "30 min", "open": "door 1"}],
    )
    content["floorplan"] = {"type": "bundled", "cell": "0.05 m", "furnish": True}
    return content


def _study():
    return {
        "base": _scenario(),
        "axes": {"robots.astro.speed": [0.3, 0.6], "who": {"options": {"a": {"name": "x"}}}},
        "replicates": 2,
        "rules": [{"when": {"who": "a"}, "set": {"users.ana.speed": 1.0}}],
        "keep": {"metrics": ["sightings.*"], "tables": ["observations"]},
        "compare": [{"metric": "sightings.astro", "against": {"robots.astro.speed": 0.3}}],
    }


def _persona():
    return yaml.safe_load((PERSONAS / "works_from_home.yaml").read_text())


def _safely(read):
    def wrapped(path):
        with running_code(allowed=False):
            return read(path)

    return wrapped


def _lives_by(path):
    user = {"type": "routine", "persona": str(path)}
    return load_scenario({"extends": "bundled:paper", "users": {"ana": user}})


# --- Runs --------------------------------------------------------------------------------------


def _read_run(path):
    """Open a run, use all of it, and compare it with its seal."""
    folder = path if path.is_dir() else path.parent
    try:
        run = fleet2d.open_run(folder)
        _ = run.metrics, run.digest, run.notes, repr(run), run.status
        for name in run.tables:
            _ = run.tables[name]
        _ = run.plan
        for body in run.manifest["entities"]["users"][:2]:
            _ = run.path(body)
    finally:
        verify_run(folder)


def _run_beside(folder):
    shutil.copytree(RUN, folder, dirs_exist_ok=True)


@cache
def _manifest():
    return json.loads((RUN / "manifest.json").read_text())


@cache
def _unfinished():
    """The files of a run that was interrupted."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        run = fleet2d.Simulation(
            "bundled:paper", "simulation.duration=2 h", seed=4, out=f"{folder}/run"
        )
        run.advance(4000)
        run.finish()
        root = Path(folder) / "run"
        return {
            p.relative_to(root).as_posix(): p.read_bytes() for p in root.rglob("*") if p.is_file()
        }


def _unfinished_beside(folder):
    for name, content in _unfinished().items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)


def _resume(path):
    """Open an unfinished run, and set it up to go on."""
    from fleet2d.engine.repeat import reopen

    root = path.parents[1]
    fleet2d.open_run(root)
    simulation, _ = reopen(root)
    simulation.advance(60)
    simulation.finish()


# --- Learned states ----------------------------------------------------------------------------


@cache
def _learned():
    with np.load(RUN / "learned" / "ltp.npz") as file:
        return {name: file[name] for name in file.files}


@st.composite
def _learned_states(draw):
    arrays = dict(_learned())
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(sorted(arrays) or ["x"]))
        value = arrays.get(name, np.zeros(3))
        match draw(st.sampled_from("nvdstrk")):
            case "n" if value.dtype.kind == "f" and value.size:
                value = value.copy()
                odd = [np.nan, np.inf, -1.0, 1e300, 0.0]
                value.flat[draw(st.integers(0, value.size - 1))] = draw(st.sampled_from(odd))
            case "v":
                value = np.array(draw(st.sampled_from([0, -1, 2**62, 1e300, np.nan, "x", True])))
            case "d":
                arrays.pop(name, None)
                continue
            case "s":
                value = value[..., :-1] if value.ndim else value
            case "t":
                kind = draw(st.sampled_from(["int8", "float32", "U3", "bool", "uint64"]))
                with np.errstate(all="ignore"):
                    value = value.astype(kind)
            case "r":
                value = value.reshape(-1)
            case _:
                name = draw(st.sampled_from([f"{name}/x", "/", "counts", "x//y", "stays/days"]))
        arrays[name] = value
    target = io.BytesIO()
    np.savez(target, **arrays)  # type: ignore[arg-type]
    return target.getvalue()


def _start_from(path):
    load_learned(path)
    algorithms = {"ltp": {"learned": str(path)}}
    changes = {"simulation": {"duration": "7 h"}, "algorithms": algorithms}
    fleet2d.Simulation({"extends": "bundled:paper", **changes}, seed=4)


# --- Tables ------------------------------------------------------------------------------------


def _parquet(columns):
    target = io.BytesIO()
    pq.write_table(pa.table(columns), target)
    return target.getvalue()


FIXES = "time,id,x,y,heading_deg\n" + "".join(
    f"2020-03-02 07:00:{second:02},a,{second / 10},1.5,90\n" for second in range(12)
)
DETECTIONS = "distance,detected,bearing_deg,identity,true_identity\n" + "".join(
    f"{row / 20},{int(row % 3 > 0)},{row % 50},ana,{'ana' if row % 5 else 'ben'}\n"
    for row in range(60)
)


FACES = "time,label,x,y,heading\n" + "".join(
    f"2020-03-02 00:{minute:02}:00,{'ana' if minute % 3 else 'person'},{16 + minute / 10},7.7,1\n"
    for minute in range(12)
)
FACES_AS_LINES = "".join(
    json.dumps({"time": float(second), "user": "ana", "x": 16.5, "y": 7.7}) + "\n"
    for second in range(12)
)
MESSAGE = {
    "type": "detections", "entity": "astro", "number": 3,
    "detections": [{"user": "ana", "x": 16.5, "y": 7.7, "heading_deg": 90}],
}  # fmt: skip


def _perceive(path):
    """Read what a real robot perceived, and let one perceive it."""
    source = {"type": "replay", "path": str(path), "time_zone": "UTC", "sort": True}
    robot = {"perceives": source, "behaviors": [{"type": "patrol"}]}
    home = scenario("1 h", users={"ana": {"type": "unknown"}}, robots={"astro": robot})
    fleet2d.run({**home, "simulation": {**home["simulation"], "start": "2020-03-02"}})


def _post(path):
    """Read a message to a live run."""
    parse_message(path.read_bytes())


def _words(text):
    """Changes to the cells of a table as to the words of a log."""
    spaced = text.replace(",", " , ")
    return lambda: lines(spaced).map(lambda content: content.replace(b" , ", b","))


def _replay(path):
    """Read a log, and live by it."""
    read_log(path, time_zone="UTC")
    user = {"type": "replay", "path": str(path), "time_zone": "UTC", "sort": True}
    if path.suffix == ".txt":
        del user["time_zone"]
    home = scenario("1 h", users={"ana": user}, robots={})
    fleet2d.Simulation({**home, "simulation": {**home["simulation"], "start": "2020-03-02"}})


def _plan(kind):
    name, content, _ = FORMATS[kind]
    make = _yaml if name.endswith("yaml") else _json
    return Reader(
        kind, name, lambda: make(content), _home, lambda folder: (folder / "map.pgm").write_bytes(PGM)
    )  # fmt: skip


def _home(path):
    """Read a home, which has free space, and rooms on all of it."""
    plan = load_floorplan(path)
    assert plan.free.any()
    assert np.array_equal(plan.free, plan.room_of_cell >= 0)


def _png():
    from PIL import Image

    target = io.BytesIO()
    shades = np.zeros((30, 40), np.uint8)
    shades[5:-5, 5:-5] = 255
    Image.fromarray(shades).save(target, "PNG")
    return target.getvalue()


def _drawing(path):
    return load_floorplan(path, resolution=0.1)


LOGS = {
    "casas": ("events.txt", CASAS),
    "uci sensors": ("home_Sensors.txt", SENSORS),
    "uci activities": ("home_ADLs.txt", ADLS),
    "homer": ("day.txt", HOMER),
    "casas events": ("data", EVENTS),
    "kasteren": ("kast_houseB-ss.txt", KASTEREN),
    "mit": ("activities_data.csv", MIT),
    "openshs": ("d1.csv", OPENSHS),
    "states": ("history.csv", STATES),
}
READERS = {
    reader.name: reader
    for reader in (
        Reader("scenario", "home.yaml", lambda: _yaml(_scenario()), _safely(load_scenario), cost=2),
        Reader("study", "study.yaml", lambda: _yaml(_study()), _safely(read_specification), cost=2),
        Reader("persona", "me.yaml", lambda: _yaml(_persona()), _safely(_lives_by)),
        *(_plan(kind) for kind in FORMATS),
        Reader("flat", "flat.json", lambda: _json(flat_document()), load_floorplan, cost=3),
        Reader("map", "map.pgm", lambda: pieces(PGM), _drawing),
        Reader("drawing", "map.png", lambda: pieces(_png()), _drawing),
        *(
            Reader(name, file, lambda text=text: lines(text), _replay, cost=2)
            for name, (file, text) in LOGS.items()
        ),
        Reader("history", "history.json", lambda: _json(json.loads(HISTORY)), _replay, cost=2),
        Reader("fixes", "rtls.csv", _words(FIXES), _replay, cost=2),
        Reader(
            "fixes as Parquet", "rtls.parquet",
            lambda: pieces(_parquet({"time": [0.0, 1.0], "x": [1.0, 2.0], "y": [1.0, 1.5]})),
            _replay, cost=2,
        ),
        Reader("detections", "seen.csv", _words(DETECTIONS), read_detections),
        Reader("faces", "faces.csv", _words(FACES), _perceive, cost=2),
        Reader("faces as lines", "faces.jsonl", lambda: lines(FACES_AS_LINES), _perceive, cost=2),
        Reader("message", "message.json", lambda: _json(MESSAGE), _post),
        Reader("manifest", "manifest.json", lambda: _json(_manifest()), _read_run, _run_beside, 3),
        Reader(
            "table", "key_frames.parquet",
            lambda: pieces((RUN / "key_frames.parquet").read_bytes()), _read_run, _run_beside, 3,
        ),
        Reader(
            "plan of a run", "floorplan.json",
            lambda: _json(json.loads((RUN / "floorplan.json").read_text())), _read_run, _run_beside, 3,
        ),
        Reader(
            "journal", "unfinished/journal",
            lambda: pieces(_unfinished()["unfinished/journal"]), _resume, _unfinished_beside, 8,
        ),
        Reader(
            "checkpoint", "unfinished/checkpoint",
            lambda: pieces(_unfinished()["unfinished/checkpoint"]), _resume, _unfinished_beside, 8,
        ),
        Reader("learned", "ltp.npz", _learned_states, _start_from, cost=5),
    )
}  # fmt: skip
"""All of them, by name."""
