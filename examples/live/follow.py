"""A program outside of Fleet2D sends a robot to the room where a person is; it needs websockets.

fleet2d live home.yaml --with ws://127.0.0.1:8765 &
python examples/live/follow.py ws://127.0.0.1:8765
"""

import json
import sys

from websockets.sync.client import connect


def follow(address: str, robot: str = "astro", person: str = "ana") -> None:
    """Send the robot to the person's room, each time that it is another one."""
    room, number = None, 0
    with connect(address) as run:
        for text in run:
            message = json.loads(text)
            if message["type"] == "note":
                print(message["text"])
            if message["type"] != "poses":
                continue
            now = message["bodies"][person]["room"]
            if now is not None and now != room:
                room = now
                print(f"{robot} goes to {room}")
                goal = {"type": "goal", "entity": robot, "to": room, "number": number}
                run.send(json.dumps(goal))
                number += 1


if __name__ == "__main__":
    if len(sys.argv) > 1:
        follow(sys.argv[1])
    else:
        print("usage: live/follow.py ws://HOST:PORT")
