"""A language model uses Fleet2D by the Model Context Protocol, in a loop of your own.

Any model that calls tools fits into `model`; this one repeats what one said, without a network.
pip install "fleet2d[mcp]" && python examples/live/talk.py
"""

import asyncio
import json
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import Any

from mcp import Client

from fleet2d.live.mcp_server import server

HOME = """extends: bundled:paper
simulation: {duration: 1 d}
users: {ana: {type: routine, persona: night_shift}}
robots: {astro: {keep_out: [bedroom]}}
"""
SAID = [
    ("components", {"kind": "behavior"}),
    ("write", {"name": "nights.yaml", "text": HOME}),
    ("check", {"scenario": "nights.yaml"}),
    ("run", {"scenario": "nights.yaml", "out": "nights"}),
    ("stays", {"run": "nights", "who": "ana", "by": "activity"}),
]


def model(words: str) -> Generator[tuple[str, Any], Any, str]:
    """Yield calls of tools with their arguments, get their results, and return an answer."""
    result: Any = words
    for call in SAID:
        result = yield call
    (sleep,) = [row for row in result if row["name"] == "sleep"]
    return f"She sleeps {sleep['hours']} h; the robot keeps out of her bedroom."


async def talk(folder: Path, words: str) -> str:
    """Let the model use the tools until it answers."""
    async with Client(server(folder)) as client:
        prompt = await client.get_prompt("scenario_from_words", {"words": words})
        turns = model(prompt.messages[0].content.text)
        tool, arguments = next(turns)
        while True:
            answer = await client.call_tool(tool, arguments)
            result = answer.structured_content
            result = result.get("result", result)
            print(f"{tool}: {json.dumps(result)[:70]}")
            try:
                tool, arguments = turns.send(result)
            except StopIteration as end:
                return str(end.value)


with tempfile.TemporaryDirectory() as place:
    print(asyncio.run(talk(Path(place), "a woman works nights; a robot must not wake her")))
