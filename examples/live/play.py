"""Plays the log of a run to a live run by UDP, as trackers and sensors of a real home would.

fleet2d export first first.jsonl
fleet2d live lab.yaml --with udp://127.0.0.1:9000 &
python examples/live/play.py first.jsonl 127.0.0.1:9000

It needs neither Fleet2D nor anything else but Python.
"""

import json
import math
import socket
import sys
import time
from collections.abc import Iterator
from datetime import datetime
from itertools import groupby
from pathlib import Path
from typing import Any

Record = dict[str, Any]


def messages_of(kind: str, records: list[Record]) -> Iterator[Record]:
    """Yield messages with the records of one kind and one step."""
    for record in records:
        if kind == "pose" and not record["away"]:
            degrees = math.degrees(record["heading"])
            place = {key: record[key] for key in ("entity", "x", "y")}
            yield {"type": "pose", **place, "heading_deg": degrees}
        if kind == "sensors":
            is_on = record["state"] in ("ON", "OPEN")
            yield {"type": "reading", "sensor": record["sensor"], "on": is_on}
    if kind == "observations":
        for robot, rows in groupby(records, lambda row: row["robot"]):
            seen = [{"user": r["user"] or "unknown", "x": r["x"], "y": r["y"]} for r in rows]
            yield {"type": "detections", "entity": robot, "detections": seen}


def play(path: str, host: str, port: int, speed: float = 1.0) -> int:
    """Send the records of a log at their times; return the number of messages."""
    with Path(path).open(encoding="utf-8") as file:
        records = [json.loads(line) for line in file]
    records.sort(key=lambda record: record["step"])
    number, began, first = 0, time.monotonic(), datetime.fromisoformat(records[0]["time"])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for (moment, kind), group in groupby(records, lambda r: (r["time"], r["record"])):
            passed = (datetime.fromisoformat(moment) - first).total_seconds() / speed
            time.sleep(max(0.0, began + passed - time.monotonic()))
            for message in messages_of(kind, list(group)):
                text = json.dumps({**message, "number": number})
                out.sendto(text.encode(), (host, port))
                number += 1
    return number


if __name__ == "__main__":
    if len(sys.argv) > 2:
        name, _, at = sys.argv[2].partition(":")
        rate = float(sys.argv[3]) if len(sys.argv) > 3 else 1.0
        print(play(sys.argv[1], name, int(at), rate), "messages")
    else:
        print("usage: live/play.py LOG.jsonl HOST:PORT [SPEED]")
