"""An algorithm in a process of its own, without Fleet2D: the share of sightings of each room.

algorithms: {share: {type: process, command: share.py, sends: [observations], period: 1 h}}
"""

import json
import sys

import pyarrow as pa

counts = []
for line in sys.stdin.buffer:
    message = json.loads(line)
    blocks = {name: sys.stdin.buffer.read(size) for name, size in message.get("blocks", [])}
    answer, data = {"type": "ready"}, b""
    if message["type"] == "start":
        counts = [0] * len(message["rooms"])
    elif message["type"] == "load":
        counts = json.loads(blocks["state"])
    elif message["type"] == "save":
        data = json.dumps(counts).encode()
        answer = {"type": "state", "blocks": [["state", len(data)]]}
    elif message["type"] == "update":
        table = pa.ipc.open_stream(blocks["observations"]).read_all()
        for room in table["room"].to_pylist():
            if room >= 0:
                counts[room] += 1
        answer = {"type": "output", "share": counts}
    sys.stdout.buffer.write(json.dumps(answer).encode() + b"\n" + data)
    sys.stdout.buffer.flush()
