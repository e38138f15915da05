"""What real parts cost: replayed detections, live runs, programs of other languages, exports.

    python benchmarks/real_parts.py [replay] [scripts] [process] [live] [ros] [export]

Without a name, all of them. Times are processor times of this process unless it says otherwise. A
live run shares the machine with all else that runs: its load is printed beside.
"""

import argparse
import itertools
import json
import multiprocessing
import os
import socket
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import fleet2d
from fleet2d.algorithms.external import Process
from fleet2d.live import Bridge, open_peer
from fleet2d.live.exporters import export

DAY_S = 86_400
PLACE = 16.5, 7.7  # in the kitchen of the bundled home [m]
PROGRAM = Path(__file__).parents[1] / "examples" / "programs" / "share.py"
BODIES = ("ana", "ben", "cora", "dan")


def base(days: int, **content: Any) -> dict[str, Any]:
    """Return the paper's scenario with changes."""
    settings = {"duration": {"days": days}, "seed": 4}
    return {"extends": "bundled:paper", "simulation": settings, **content}


def detections(path: Path, count: int, days: int) -> Path:
    """Write a log with detections of a person at random seconds."""
    seconds = np.sort(np.random.default_rng(0).integers(0, days * DAY_S, count))
    times = np.datetime64("2026-01-05T00:00:00", "s") + seconds
    x, y = PLACE
    lines = (f"{moment},ana,{x},{y}\n" for moment in times)
    path.write_text("time,user,x,y\n" + "".join(lines))
    return path


def timed(action: Callable[[], Any]) -> float:
    """Return the processor time of an action [s]."""
    began = time.process_time()
    action()
    return time.process_time() - began


def percentiles(name: str, seconds: Sequence[float]) -> None:
    """Print the median, the 99th percentile and the maximum of times."""
    ranks = np.percentile(seconds, (50, 99, 100)) * 1e3
    print(f"{name}: p50 {ranks[0]:.2f}, p99 {ranks[1]:.2f}, max {ranks[2]:.2f} ms")


def replay(folder: Path) -> None:
    """Time runs whose robot perceives what a log has, in place of its cameras."""
    fleet2d.run(base(1))
    for days, must in ((1, 2), (30, 60)):
        count = days * DAY_S
        log = {"type": "replay", "path": str(detections(folder / "log.csv", count, days))}
        content = base(days, robots={"astro": {"perceives": log}})
        took = timed(lambda content=content: fleet2d.run(content))
        print(f"replay: {count:,} detections in {days} days: {took:.2f} s (must {must})")


def scripts(folder: Path) -> None:
    """Time detections that come besides those of the cameras: a script, and a table."""
    fleet2d.run(base(1))
    x, y = PLACE
    ghost = {"do": "inject", "entity": "astro", "user": "ana", "spot": [x, y], "duration": "1 s"}
    for count in (1000, 4000):
        entries = [{"at": f"{i * DAY_S // count} s", **ghost} for i in range(count)]
        took = timed(lambda: fleet2d.run(base(1)))
        took = timed(lambda entries=entries: fleet2d.run(base(1, script=entries))) - took
        print(f"scripts: {count:,} lines of inject: {took / count * 1e3:.2f} ms each")
    days, count = 30, 1_000_000
    path = str(detections(folder / "ghosts.csv", count, days))
    table = {"type": "replay", "path": path, "besides_cameras": True}
    took = timed(lambda: fleet2d.run(base(days)))
    took = timed(lambda: fleet2d.run(base(days, robots={"astro": {"perceives": table}}))) - took
    print(f"scripts: a table of {count:,}: {took / count * 1e3:.4f} ms each (must 0.05)")


def process(_: Path) -> None:
    """Time the updates of an algorithm in another process."""
    for sends in (["observations"], ["observations", "evidence", "poses"]):
        wall, own = [], []
        update = Process.update

        def timed_update(*args: Any, update: Any = update) -> Any:
            began, began_own = time.perf_counter(), time.process_time()
            result = update(*args)
            wall.append(time.perf_counter() - began)  # noqa: B023 - called in this iteration
            own.append(time.process_time() - began_own)  # noqa: B023
            return result

        share = {"type": "process", "command": str(PROGRAM), "sends": sends, "period": "5 min"}
        with patch.object(Process, "update", timed_update):
            fleet2d.run(base(5, algorithms={"share": share}))
        percentiles(f"process: update with {', '.join(sends)} (must 1)", wall[1:])
        print(f"process: of it here {statistics.mean(own[1:]) * 1e3:.2f} ms of processor time")


def send_poses(port: int, every_s: float) -> None:
    """Send poses of people and of a robot by UDP, as a tracker does, for ever."""
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    number = 0
    while True:
        for entity in (*BODIES, "astro"):
            x, y = PLACE[0] + number % 10 / 100, PLACE[1]
            message = {"type": "pose", "entity": entity, "x": x, "y": y, "number": number}
            out.sendto(json.dumps(message).encode(), ("127.0.0.1", port))
            number += 1
        time.sleep(every_s)


def hear(port: int) -> None:
    """Receive all messages of a run by WebSocket."""
    from websockets.sync.client import connect

    with connect(f"ws://127.0.0.1:{port}") as run:
        for _ in run:
            pass


def live(_: Path) -> None:
    """Measure how late the steps of a live run with five bodies begin, and what it costs."""
    for step, seconds in (("1 s", 60), ("100 ms", 60)):
        content = base(1, users={name: {"type": "live"} for name in BODIES})
        content["simulation"] |= {"step": step, "duration": f"{seconds} s"}
        content["robots"] = {"astro": {"behaviors": [{"type": "live"}]}}
        simulation = fleet2d.Simulation(content)
        peers: list[Any] = [open_peer("udp://127.0.0.1:0"), open_peer("ws://127.0.0.1:0")]
        bridge = Bridge(simulation, peers)
        others = [
            multiprocessing.Process(target=send_poses, args=(peers[0].port, 1.0), daemon=True),
            multiprocessing.Process(target=hear, args=(peers[1].port,), daemon=True),
        ]
        for other in others:
            other.start()
        took = timed(bridge.run)
        for other in others:
            other.terminate()
        percentiles(f"live: five bodies, steps of {step}, late (must 5)", list(bridge.lateness_s))
        print(f"live: {took / seconds:.2%} of a core (must 3); {bridge.notes()[0]}")


def drive(port: int, robots: int, latencies: "multiprocessing.Queue[float]") -> None:
    """Hear all topics of robots by ROS 2, drive one, and tell how late its odometry shows that."""
    from fleet2d.live.ros.types import RosTypes
    from fleet2d.live.ros.zenoh_node import ZenohNode

    node = ZenohNode(RosTypes("jazzy"), port=port)
    moves = threading.Event()

    def hear_odometry(message: dict[str, Any]) -> None:
        if message["twist"]["twist"]["linear"]["x"]:
            moves.set()

    def ignore(*_: Any) -> None:
        pass

    node.subscribe("/clock", "rosgraph_msgs/msg/Clock", ignore, ignore)
    node.subscribe("/tf", "tf2_msgs/msg/TFMessage", ignore, ignore)
    for number in range(robots):
        heard = ignore if number else hear_odometry
        node.subscribe(f"/r{number}/odom", "nav_msgs/msg/Odometry", heard, ignore)
        node.subscribe(f"/r{number}/scan", "sensor_msgs/msg/LaserScan", ignore, ignore)
    send = node.publisher("/r0/cmd_vel", "geometry_msgs/msg/Twist")
    for number in itertools.count():
        time.sleep(1.5 + number % 7 / 70)  # the robot stands again, and steps begin at any moment
        moves.clear()
        sent = time.perf_counter()
        send({"linear": {"x": 0.05 if number % 2 else -0.05}})
        if moves.wait(1):
            latencies.put(time.perf_counter() - sent)


def ros(_: Path) -> None:
    """Measure what ten robots cost beside the run at 10 Hz, and how late a command shows."""
    from fleet2d.live.ros.ros2 import Ros2Peer

    port, seconds = 17_447, 40
    content = base(1, users={"ana": {"type": "live"}})
    content["simulation"] |= {"step": "100 ms", "duration": f"{seconds} s"}
    content["robots"] = {f"r{number}": {"behaviors": [{"type": "live"}]} for number in range(10)}
    alone = timed(Bridge(fleet2d.Simulation(content), [open_peer("udp://127.0.0.1:0")]).run)
    peer = Ros2Peer(port=port, path="jazzy")
    context = multiprocessing.get_context("spawn")  # threads of zenoh don't survive a fork
    latencies = context.Queue()
    other = context.Process(target=drive, args=(port, 10, latencies), daemon=True)
    other.start()
    bridge = Bridge(fleet2d.Simulation(content), [peer])
    took = timed(bridge.run)
    other.terminate()
    print(f"ros: {(took - alone) / seconds:.1%} of a core beside the run (must 15)")
    times = [latencies.get() for _ in range(latencies.qsize())]
    percentiles("ros: command until odometry, steps of 100 ms (must 105)", times)
    percentiles("ros: of it because the machine began a step late", list(bridge.lateness_s))


def export_month(folder: Path) -> None:
    """Time the export of the base month to MCAP."""
    run = fleet2d.run(base(30))
    export(run, folder / "hour.mcap", end=3600)
    path = folder / "month.mcap"
    took = timed(lambda: export(run, path))
    print(f"export: {took:.1f} s (must 30), {path.stat().st_size / 1e6:.0f} MB (must 300)")


MEASURES = {
    "replay": replay,
    "scripts": scripts,
    "process": process,
    "live": live,
    "ros": ros,
    "export": export_month,
}


def main() -> None:
    """Measure what is named."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MEASURES))
    names = parser.parse_args().names or list(MEASURES)
    for name in names:
        if name not in MEASURES:
            parser.error(f"there is no measure {name!r}: {', '.join(MEASURES)}")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            MEASURES[name](Path(folder))
        print(f"{name}: load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", flush=True)


if __name__ == "__main__":
    main()
