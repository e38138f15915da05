"""Peers over UDP and WebSocket, with real clients, and another process without Fleet2D."""

import json
import socket
import subprocess
import sys
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from tests.live.scenes import LIVE, place
from tests.viewing.browser import chromium

import fleet2d
from fleet2d.errors import InputError
from fleet2d.live import Bridge, open_peer, peers

EXAMPLES = Path(__file__).parents[2] / "examples"


def in_background(bridge: Bridge) -> tuple[threading.Thread, list[Any]]:
    runs = []
    thread = threading.Thread(target=lambda: runs.append(bridge.run()))
    thread.start()
    return thread, runs


@pytest.mark.slow
def test_datagrams_move_a_body():
    peer = open_peer("udp://127.0.0.1:0")
    port, simulation = peer.port, fleet2d.Simulation(LIVE)  # it is closed when the run ends
    thread, runs = in_background(Bridge(simulation, [peer], speed=30))
    x, y = place()
    message = json.dumps({"type": "pose", "entity": "ana", "x": x, "y": y}).encode()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while thread.is_alive():
            sender.sendto(message, ("127.0.0.1", port))
            time.sleep(0.05)
    thread.join()

    assert runs[0].status == "complete"
    assert simulation.state["ana"]["x"] == pytest.approx(x, abs=1e-3)


@pytest.mark.parametrize("scheme", ["udp", "ws"])
def test_an_address_in_use_is_refused(scheme):
    if scheme == "ws":
        pytest.importorskip("websockets", reason="the extra live is not installed")
    kind = socket.SOCK_DGRAM if scheme == "udp" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        if scheme == "ws":
            taken.listen()
        with pytest.raises(InputError, match=f"{scheme}://127.0.0.1:"):
            open_peer(f"{scheme}://127.0.0.1:{taken.getsockname()[1]}")


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("tcp://localhost:1", ""),
        ("localhost:99", ""),
        ("ws://h:port", ": Port could not be cast to integer value as 'port'"),
        ("ws://h:99999", ": Port out of range 0-65535"),
        ("udp://", ": it has no host"),
        ("ws://[::1", ": Invalid IPv6 URL"),
        ("mqtt://nas/lab/#", ": #, \\+ and \\? have no meaning in it"),
        ("mqtt://nas/a/+/b", ": #, \\+ and \\? have no meaning in it"),
        ("", ""),
    ],
)
def test_a_wrong_address_is_refused(address, why):
    with pytest.raises(InputError, match=f"is not the address of a peer{why}"):
        open_peer(address)


def test_a_client_hears_all_and_sends_goals():
    pytest.importorskip("websockets", reason="the extra live is not installed")
    from websockets.sync.client import connect

    peer = open_peer("ws://127.0.0.1:0")
    simulation = fleet2d.Simulation(LIVE)
    bridge = Bridge(simulation, [peer], speed=30)
    thread, runs = in_background(bridge)
    heard = []
    with connect(f"ws://127.0.0.1:{peer.port}") as client:
        client.send(json.dumps({"type": "goal", "entity": "astro", "to": "kitchen_1"}))
        client.send("?")
        heard = [json.loads(text) for text in client]
    thread.join()

    hello, end = heard[0], heard[-1]
    assert (hello["type"], hello["users"], hello["robots"]) == ("hello", ["ana"], ["astro"])
    assert {"kitchen_1"} <= {room["name"] for room in hello["rooms"]}
    assert end == {"type": "end", "status": "complete", "digest": runs[0].digest}
    assert {"poses", "note"} <= {message["type"] for message in heard}
    steps = [message["step"] for message in heard if message["type"] == "poses"]
    assert steps == sorted(steps)
    assert [act["do"] for act in runs[0].manifest["interventions"]] == ["send"]


@pytest.mark.slow
def test_a_client_that_leaves_does_not_stop_the_run():
    pytest.importorskip("websockets", reason="the extra live is not installed")
    from websockets.sync.client import connect

    peer = open_peer("ws://127.0.0.1:0")
    thread, runs = in_background(Bridge(fleet2d.Simulation(LIVE), [peer], speed=30))
    with connect(f"ws://127.0.0.1:{peer.port}") as client:
        client.recv()
        client.socket.shutdown(socket.SHUT_RDWR)
    thread.join()

    assert runs[0].status == "complete"


def shaken(port) -> socket.socket:
    """Return a client that never reads what it gets."""
    client = socket.create_connection(("127.0.0.1", port))
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13"
    upgrade = f"Upgrade: websocket\r\nConnection: Upgrade\r\n{key}"
    client.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n{upgrade}\r\n\r\n".encode())
    return client


@pytest.mark.slow
def test_a_client_that_never_reads_is_disconnected_and_told(monkeypatch, capfd):
    pytest.importorskip("websockets", reason="the extra live is not installed")
    monkeypatch.setattr(peers, "MAX_QUEUE", 20)
    peer = open_peer("ws://127.0.0.1:0")
    told = []
    bridge = Bridge(fleet2d.Simulation(LIVE), [peer], speed=60, tell=told.append)
    peer.open, own = lambda *a: (own(*a), clients.append(shaken(peer.port))), peer.open
    clients = []
    port = peer.port  # it is closed when the run ends
    huge = {"type": "note", "text": "x" * 1_000_000}
    send = peer.send
    peer.send = lambda frame: (send(frame), peer._put([json.dumps(huge)]))
    run = bridge.run()
    clients[0].close()

    assert run.status == "complete"
    assert bridge.counts["slow clients"] == 1
    assert f"slow clients: a client of ws://127.0.0.1:{port} doesn't read: it is" in told[0]
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.slow
def test_clients_that_speak_no_websocket_leave_no_traceback(capfd):
    pytest.importorskip("websockets", reason="the extra live is not installed")
    peer = open_peer("ws://127.0.0.1:0")
    bridge = Bridge(fleet2d.Simulation(LIVE), [peer], speed=15)
    port = peer.port
    thread, runs = in_background(bridge)
    for content in (b"\x16\x03\x01\x02\x00 no HTTP \r\n\r\n", b"GET / HTTP/1.1\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", port)) as client:
            client.sendall(content)
            client.recv(1000)
    thread.join()

    assert runs[0].status == "complete"
    assert bridge.counts == {"refused clients": 1}
    assert "Failed to open a WebSocket connection" in bridge.notes()[1]
    assert "Traceback" not in capfd.readouterr().err


def test_pages_of_other_sites_are_refused():
    """Any page that is open in a browser of this machine could send a robot somewhere."""
    pytest.importorskip("websockets", reason="the extra live is not installed")
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    peer = open_peer("ws://127.0.0.1:0")
    bridge = Bridge(fleet2d.Simulation(LIVE), [peer], speed=15)
    thread, _ = in_background(bridge)
    address = f"ws://127.0.0.1:{peer.port}"
    for origin in ("https://example.com", "null", "http://localhost.example.com"):
        with pytest.raises(InvalidStatus, match="403"), connect(address, origin=origin):
            pass
    thread.join()

    assert bridge.counts == {"refused clients": 3}


@pytest.mark.slow
def test_a_page_in_chromium_shows_a_run_and_sends_a_robot():
    pytest.importorskip("websockets", reason="the extra live is not installed")
    pages = partial(SimpleHTTPRequestHandler, directory=str(EXAMPLES / "live"))
    with chromium() as browser, ThreadingHTTPServer(("127.0.0.1", 0), pages) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        peer = open_peer("ws://127.0.0.1:0")
        page = browser.new_page()
        simulation = fleet2d.Simulation(LIVE, "simulation.duration=80 s")  # a page takes long
        thread, runs = in_background(Bridge(simulation, [peer], speed=10))
        run = f"?run=ws://127.0.0.1:{peer.port}"
        page.goto(f"http://127.0.0.1:{server.server_port}/page.html{run}")
        page.get_by_role("button", name="kitchen_1").click()
        page.get_by_text("the run is over: ").wait_for(timeout=40_000)
        bodies, log = page.locator("#bodies").inner_text(), page.locator("#log").inner_text()
        server.shutdown()
    thread.join()

    acts = runs[0].manifest["interventions"]
    assert [(act["do"], act["entity"], act["to"]) for act in acts] == [
        ("send", "astro", "kitchen_1")
    ]
    assert "astro: " in bodies
    assert f"the run is over: {runs[0].digest}" in log


def test_a_program_without_fleet2d_decides_where_the_robot_goes(tmp_path):
    websockets = pytest.importorskip("websockets", reason="the extra live is not installed")
    content = LIVE | {
        "users": {
            "ana": {
                "type": "schedule",
                "days": [{"items": [{"at": "00:00", "place": "kitchen_1"}]}],
            }
        },
        "robots": {"astro": {"behaviors": [{"type": "live"}]}},
        "simulation": {"duration": "2 min", "seed": 4, "start": "2026-01-05T12:00"},
    }
    peer = open_peer("ws://127.0.0.1:0")
    simulation = fleet2d.Simulation(content)
    thread, runs = in_background(Bridge(simulation, [peer], speed=40))
    # An interpreter that has this library alone, and neither Fleet2D nor its environment.
    (tmp_path / "websockets").symlink_to(Path(websockets.__file__).parent)
    alone = {"env": {"PYTHONPATH": str(tmp_path)}, "cwd": tmp_path, "timeout": 30, "check": False}
    python = [sys.executable, "-S"]
    tried = subprocess.run([*python, "-c", "import fleet2d"], capture_output=True, **alone)
    program = subprocess.run(
        [*python, str(EXAMPLES / "live/follow.py"), f"ws://127.0.0.1:{peer.port}"],
        capture_output=True,
        text=True,
        **alone,
    )
    thread.join()

    assert tried.returncode == 1
    assert program.returncode == 0, program.stderr
    assert "astro goes to kitchen_1" in program.stdout
    assert runs[0].status == "complete"
    assert runs[0].manifest["interventions"][0]["do"] == "send"
