"""Assistants: tools within one folder, over the official SDK."""

import asyncio
import json
import os
import time
from itertools import pairwise
from typing import Any

import pytest

from fleet2d.errors import Fleet2DError, InputError
from fleet2d.live import mcp_server
from fleet2d.live.mcp_server import Workspace, server
from fleet2d.scenario import schema

HOME = "extends: bundled:paper\nsimulation: {duration: 3 h, start: 2026-01-05T07:00}\n"


@pytest.fixture
def place(tmp_path):
    folder = tmp_path / "homes"
    folder.mkdir()
    (tmp_path / "secret.yaml").write_text("name: secret\n")
    workspace = Workspace(folder)
    workspace.write("home.yaml", HOME)
    return workspace


@pytest.mark.slow
def test_a_scenario_is_written_checked_run_and_asked(place):
    assert place.check("home.yaml")["users"] == ["ana"]

    result = place.run("home.yaml", "first", ["simulation.seed=7"])

    assert result["steps"] == 10800
    assert place.files() == ["first/", "home.yaml"]
    rows = place.ask("first", "observations", "user == ana", ["step", "user", "room"], limit=3)
    assert rows["rows"] == result["tables"]["observations"]
    assert len(rows["shown"]) == 3
    assert place.ask("first", "observations", where="step >= 10000000")["rows"] == 0
    assert place.picture("first").startswith(b"\x89PNG")


def test_a_simulation_waits_for_interventions(place):
    name = place.begin("home.yaml")
    place.advance(name, "10 min")

    place.intervene(name, {"put": "ana", "to": "kitchen"})
    state = place.advance(name, "1 s")

    assert state["state"]["ana"]["room"] == "kitchen_1"
    assert place.advance(name, "08:00")["time"] == "2026-01-05T08:00:00"
    assert place.finish(name)["status"] == "interrupted"
    with pytest.raises(InputError, match="there is no simulation 'simulation_1'"):
        place.finish(name)


@pytest.mark.parametrize("name", ["../secret.yaml", "/etc/passwd", "", ".", "a/../../secret.yaml"])
def test_paths_out_of_the_folder_are_refused(place, name):
    for use in (place.read, lambda n: place.write(n, "x"), place.check, place.picture):
        with pytest.raises(InputError, match="leads out of the folder"):
            use(name)
    with pytest.raises(InputError, match="leads out of the folder"):
        place.run("home.yaml", name)


def test_links_out_of_the_folder_are_refused(place, tmp_path):
    (place.folder / "link.yaml").symlink_to(tmp_path / "secret.yaml")

    with pytest.raises(InputError, match="leads out of the folder"):
        place.read("link.yaml")


@pytest.mark.parametrize(
    "text",
    [
        "extends: ../secret.yaml\n",
        HOME + "floorplan: {type: native, path: ../secret.yaml}\n",
        HOME + "algorithms: {x: {type: 'os:system'}}\n",
        HOME + "algorithms: {x: {type: process, command: ../secret.yaml}}\n",
        HOME + "algorithms: {x: {type: process, command: home.yaml}}\n",
        HOME + "users: {ana: {type: replay, path: ../secret.yaml}}\n",
    ],
)
def test_files_outside_and_code_are_refused(place, text):
    place.write("bad.yaml", text)

    with pytest.raises(Fleet2DError):
        place.check("bad.yaml")


@pytest.mark.parametrize("persona", ["{outside}", "../secret.yaml", "inside.yaml"])
def test_nothing_outside_is_quoted_in_a_message(place, persona):
    """The message about a persona that was none began with the file's first line."""
    secret = place.folder.parent / "secret.yaml"
    secret.write_text("password 1234\n")
    place.write("inside.yaml", "extends: ../secret.yaml\n")
    persona = persona.format(outside=secret)
    place.write("bad.yaml", f"{HOME}users: {{ana: {{type: routine, persona: {persona}}}}}\n")
    override = f"users.ana={{type: routine, persona: {secret}}}"

    for use in (lambda: place.check("bad.yaml"), lambda: place.begin("home.yaml", [override])):
        with pytest.raises(InputError, match="is outside of the folder") as caught:
            use()
        assert "1234" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: !!python/object/apply:os.system [x]\n", "bad.yaml:1: the tag .* can't be used here"),
        ("a: [\n", "bad.yaml:2: not valid YAML: a value is missing"),
        (
            "extends: bundled:paper\nsimulation: {duration: 100000 d}\n",
            "would take minutes or more",
        ),
    ],
)
def test_a_wrong_file_is_told(place, text, message):
    place.write("bad.yaml", text)

    with pytest.raises(InputError, match=message):
        place.check("bad.yaml")


def test_a_wrong_time_and_name_are_told(place):
    name = place.begin("home.yaml")

    with pytest.raises(InputError, match="is outside of the folder"):
        place.intervene(name, {"reset": "ltp", "learned": str(place.folder.parent / "secret.yaml")})
    with pytest.raises(InputError, match="nonsense"):
        place.advance(name, "nonsense")
    with pytest.raises(InputError, match="can't be the name of a file"):
        place.read("\0")


@pytest.mark.parametrize(
    ("question", "message"),
    [
        ({"table": "rooms"}, "there is no table 'rooms'"),
        ({"table": "events", "columns": ["who"]}, "there is no column 'who'"),
        ({"table": "events", "where": "who == ana"}, "there is no column 'who'"),
        ({"table": "events", "where": "step > soon"}, "there is no column 'soon'"),
    ],
)
def test_a_wrong_question_is_answered_with_what_there_is(place, question, message):
    place.run("home.yaml", "first", ["simulation.duration=1 min"])

    with pytest.raises(InputError, match=message):
        place.ask("first", **question)


@pytest.mark.parametrize(
    ("where", "rows"),
    [("event == user_seen", 4), ("event == 'user_seen' and entity == 'astro'", 4)],
)
def test_conditions_of_rows_are_joined(place, where, rows):
    """Only astro sees; a condition with `and` had 0 rows."""
    place.run("home.yaml", "first")

    assert place.ask("first", "events", where, limit=1)["rows"] == rows
    with pytest.raises(InputError, match="no 'usr_seen' in the column event: did you mean"):
        place.ask("first", "events", "event == usr_seen")


def test_the_query_of_the_description_sums_durations(place):
    place.run("home.yaml", "first")
    query = (Workspace.ask.__doc__ or "").partition("[s]:\n")[2].partition("Args:")[0]

    rows = place.ask("first", query=query)["shown"]

    events = place.ask("first", "events", "event = 'activity'", ["detail", "epoch(time) AS at"])
    acts = events["shown"]
    lasts = {}
    for act, after in pairwise(acts):
        lasts[act["detail"]] = lasts.get(act["detail"], 0) + after["at"] - act["at"]
    assert len(acts) > 2
    assert {row["detail"]: row["seconds"] for row in rows if row["seconds"] is not None} == lasts
    with pytest.raises(InputError, match="not both"):
        place.ask("first", "events", query=query)


@pytest.mark.parametrize(
    "text",
    ['{"extends": "SECRET"}', '{"extends": "../secret.yaml"}', '{"extends": "/etc/passwd"}'],
)
def test_a_json_file_leads_nowhere_else(place, text):
    """Only the files of YAML were looked through for paths."""
    place.write("inner.json", text.replace("SECRET", str(place.folder.parent / "secret.yaml")))
    place.write("bad.yaml", "extends: [bundled:paper, inner.json]\n")

    with pytest.raises(InputError, match="is outside of the folder"):
        place.check("bad.yaml")


@pytest.mark.parametrize(
    "name", ["\0", "a\0.yaml", "\x1b[2J.yaml", "a\nb.yaml", "\ud800.yaml", "x" * 5000 + ".yaml"]
)
def test_odd_names_are_refused_in_one_line(place, name):
    uses = [
        place.read, lambda n: place.write(n, "x"), place.check, place.picture, place.begin,
        lambda n: place.run("home.yaml", n), lambda n: place.ask(n, "events"), place.finish,
        lambda n: place.ask("first", n), lambda n: place.ask("first", "events", n),
        lambda n: place.run(f"bundled:{n}"), lambda n: place.check("home.yaml" + n),
        lambda n: place.begin("home.yaml", [f"users.ana={{type: routine, persona: {n!r}}}"]),
        lambda n: place.advance("simulation_1", n), lambda n: place.write("a.yaml", n + "\ud800"),
    ]  # fmt: skip
    place.run("home.yaml", "first", ["simulation.duration=1 min"])
    place.begin("home.yaml")
    for use in uses:
        with pytest.raises(Fleet2DError) as caught:
            use(name)
        assert str(caught.value).isprintable()


def test_pipes_in_the_folder_are_refused_and_replaced(place):
    os.mkfifo(place.folder / "pipe.yaml")

    for use in (place.read, place.check):
        with pytest.raises(InputError, match="is a device or a pipe"):
            use("pipe.yaml")
    place.write("pipe.yaml", HOME)
    assert place.read("pipe.yaml") == HOME


def test_a_run_at_the_pace_of_a_clock_is_refused(place):
    for use in (place.run, place.begin):
        with pytest.raises(InputError, match=r"override it by simulation\.speedup=null"):
            use("home.yaml", overrides=["simulation.speedup=0.001"])


@pytest.mark.slow
def test_a_call_simulates_for_a_limited_time(place, monkeypatch):
    name = place.begin("home.yaml", ["simulation.duration=5000 d"])
    monkeypatch.setattr(mcp_server, "MAX_S", 0.3)

    with pytest.raises(InputError, match=r"simulates for 0\.3 s at most.*: ask for a shorter"):
        place.run("home.yaml", "first", ["simulation.duration=5000 d"])
    assert place.ask("first", "events")["rows"] > 0
    with pytest.raises(InputError, match=r"0\.3 s at most, which ended at .*the state is kept"):
        place.advance(name, "4000 d")
    monkeypatch.setattr(mcp_server, "MAX_S", 60)
    assert place.advance(name, "1 min")["state"]["ana"]


def busy(*_, **__):
    """Compute for longer than a call may take."""
    end = time.monotonic() + 30
    while time.monotonic() < end:
        sum(range(1000))


@pytest.mark.parametrize("slow", ["load_scenario", "open_run"])
def test_all_that_a_call_does_has_a_limited_time(place, monkeypatch, slow):
    monkeypatch.setattr(mcp_server, "MAX_CALL_S", 0.3)
    monkeypatch.setattr(mcp_server, slow, busy)
    use = place.check if slow == "load_scenario" else place.picture

    begin = time.monotonic()
    with pytest.raises(InputError, match=r"one call takes 0\.3 s at most"):
        use("home.yaml")
    assert time.monotonic() < begin + 15
    assert HOME == place.read("home.yaml")


def test_a_simulation_whose_metrics_take_too_long_is_gone(place, monkeypatch):
    name = place.begin("home.yaml")
    monkeypatch.setattr(mcp_server, "MAX_CALL_S", 0.3)
    for step in ("advance", "finish"):
        monkeypatch.setattr(mcp_server.Simulation, step, busy)

    with pytest.raises(InputError, match="one call takes"):
        place.advance(name, "1 min")
    with pytest.raises(InputError, match=f"no simulation '{name}'"):
        place.finish(name)


def test_components_are_listed_by_part_and_briefly(monkeypatch):
    described = schema.describe_components()
    monkeypatch.setattr(schema, "describe_components", lambda: described)  # which takes a while
    kinds = [line.partition(":")[0] for line in mcp_server.list_components().splitlines()]

    assert len(mcp_server.list_components()) < 4000
    assert all(len(mcp_server.list_components(kind)) < 4000 for kind in kinds)
    assert "dwell" in mcp_server.list_components("behavior", "patrol")
    with pytest.raises(InputError, match="did you mean 'behavior'"):
        mcp_server.list_components("behaviour")
    with pytest.raises(InputError, match="did you mean 'patrol'"):
        mcp_server.list_components("behavior", "patroll")


@pytest.mark.slow
def test_a_client_uses_the_tools(place):
    mcp = pytest.importorskip("mcp", reason="the extra mcp is not installed")

    async def use() -> tuple[set[str], Any, list[Any], list[Any]]:
        async with mcp.Client(server(place.folder)) as client:
            tools = {tool.name for tool in (await client.list_tools()).tools}
            done = await client.call_tool("run", {"scenario": "home.yaml", "out": "first"})
            wrong = [
                await client.call_tool("read", {"name": "../secret.yaml"}),
                await client.call_tool("run", {"scenario": "home.yaml", "name": "first"}),
            ]
            more = [
                await client.call_tool("stays", {"run": "first", "who": "ana"}),
                await client.get_prompt("scenario_from_words", {"words": "a couple and a robot"}),
                await client.read_resource("fleet2d://first/manifest"),
                await client.read_resource("fleet2d://first/picture"),
            ]
            return tools, done, wrong, more

    tools, done, wrong, (stays, prompt, manifest, picture) = asyncio.run(use())

    assert {"components", "write", "check", "run", "ask", "picture", "intervene"} <= tools
    assert "longest_hours" in stays.content[0].text
    assert "a couple and a robot" in prompt.messages[0].content.text
    assert json.loads(manifest.contents[0].text)["steps"] == 10800
    assert picture.contents[0].mime_type == "image/png"
    assert json.loads(done.content[0].text)["steps"] == 10800
    assert all(answer.is_error for answer in wrong)
    assert "leads out of the folder" in wrong[0].content[0].text
    assert "Extra inputs are not permitted" in wrong[1].content[0].text
