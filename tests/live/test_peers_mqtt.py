"""MQTT: a real broker and a real client; Home Assistant finds sensors and bodies."""

import contextlib
import json
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.live.scenes import LIVE, place

import fleet2d
from fleet2d.errors import InputError
from fleet2d.live import Bridge, open_peer, peers

pytest.importorskip("paho.mqtt.client", reason="the extra mqtt is not installed")
BROKER = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")


@pytest.fixture
def mosquitto(tmp_path):
    """Start Mosquitto on a free port."""
    port = free_port()
    with mosquitto_at(port, tmp_path) as process:
        yield port, process


def free_port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@contextlib.contextmanager
def mosquitto_at(port, tmp_path: Path) -> Iterator["subprocess.Popen[bytes]"]:
    if BROKER is None:
        pytest.skip("mosquitto is not installed")
    config = tmp_path / "mosquitto.conf"
    config.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    process = subprocess.Popen([BROKER, "-c", str(config)], stderr=subprocess.DEVNULL)
    try:
        for _ in range(100):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.05)
        yield process
    finally:
        process.terminate()
        process.wait()


@pytest.fixture
def broker(mosquitto):
    return mosquitto[0]


class Client:
    """A client that keeps what it hears."""

    def __init__(self, port):
        from paho.mqtt.client import Client as MqttClient
        from paho.mqtt.enums import CallbackAPIVersion

        self.heard: list[tuple[str, str]] = []
        self.is_on = threading.Event()
        self.mqtt = MqttClient(CallbackAPIVersion.VERSION2)
        self.mqtt.on_message = lambda *a: self.heard.append((a[-1].topic, a[-1].payload.decode()))
        self.mqtt.on_subscribe = lambda *a: self.is_on.set()
        self.mqtt.connect("127.0.0.1", port)
        self.mqtt.subscribe("#")
        self.mqtt.loop_start()
        assert self.is_on.wait(5)

    def of(self, topic):
        return [payload for name, payload in self.heard if name == topic]

    def close(self):
        self.mqtt.disconnect()
        self.mqtt.loop_stop()
        self.mqtt.on_message = self.mqtt.on_subscribe = None
        del self.mqtt  # closes its sockets


@pytest.mark.slow
def test_a_broker_passes_on_what_happens_and_what_arrives(broker):
    client = Client(broker)
    peer = open_peer(f"mqtt://127.0.0.1:{broker}/home/one")
    content = LIVE | {
        "objects": LIVE["objects"] | {"hall": {"type": "motion_sensor", "at": place()}}
    }
    simulation = fleet2d.Simulation(content)
    x, y = place()
    pose = {"type": "pose", "entity": "ana", "x": x, "y": y}
    reading = {"type": "reading", "sensor": "front_door", "on": True}
    for message in (pose, reading):
        client.mqtt.publish("home/one/in/any", json.dumps(message), qos=1)
    bridge = Bridge(simulation, [peer], speed=10)
    thread = threading.Thread(target=bridge.run)
    thread.start()
    for message in (pose, reading, {"type": "nonsense"}):
        time.sleep(0.3)
        client.mqtt.publish("home/one/in/any", json.dumps(message), qos=1)
    thread.join()
    time.sleep(0.2)
    client.close()

    config = json.loads(client.of("homeassistant/binary_sensor/home_one/hall/config")[0])
    assert config["device_class"] == "motion"
    assert config["state_topic"] == "home/one/sensor/hall"
    assert config["availability_topic"] == "home/one/status"
    assert "homeassistant/sensor/home_one/ana/config" in dict(client.heard)
    assert client.of("home/one/status")[-2:] == ["online", "offline"]
    assert client.of("home/one/sensor/front_door")[:2] == ["OFF", "ON"]
    assert json.loads(client.of("home/one/pose/ana")[-1])["x"] == pytest.approx(x, abs=1e-3)
    assert any("wrong: " in text for text in client.of("home/one/note"))
    assert bridge.counts["applied"] >= 2


@pytest.mark.slow
def test_goals_are_withdrawn_when_the_broker_is_gone(mosquitto):
    port, process = mosquitto
    peer = open_peer(f"mqtt://127.0.0.1:{port}/home")
    told = []
    bridge = Bridge(fleet2d.Simulation(LIVE), [peer], speed=10, tell=told.append)
    thread = threading.Thread(target=bridge.run)
    thread.start()
    client = Client(port)
    goal = {"type": "goal", "entity": "astro", "to": "kitchen_1"}
    client.mqtt.publish("home/in/any", json.dumps(goal), qos=1).wait_for_publish(5)
    while thread.is_alive() and not bridge.counts["applied"]:
        time.sleep(0.01)
    process.kill()
    thread.join()
    client.close()

    assert told == [
        f"lost connections: mqtt://127.0.0.1:{port}: the connection is tried again",
        "astro: who sent it to kitchen_1 is gone: the goal is withdrawn",
    ]


def test_a_broker_that_is_missing_is_told_and_hears_the_run_once_it_is_there(tmp_path):
    port = free_port()
    told = []
    peer = open_peer(f"mqtt://127.0.0.1:{port}/home")
    bridge = Bridge(fleet2d.Simulation(LIVE), [peer], speed=5, tell=told.append)
    thread = threading.Thread(target=bridge.run)
    thread.start()
    with mosquitto_at(port, tmp_path):
        client = Client(port)
        thread.join()
        client.close()
    assert f"mqtt://127.0.0.1:{port}: there is no broker yet; it is tried again" in told[0]
    assert client.of("home/pose/ana")
    assert client.of("home/status")[-2:] == ["online", "offline"]


@pytest.mark.slow
def test_two_runs_with_one_prefix_are_told(broker):
    """Each applied what the other was sent, and neither said so."""
    told = [[], []]
    address = f"mqtt://127.0.0.1:{broker}/home"
    bridges = [
        Bridge(fleet2d.Simulation(LIVE), [open_peer(address)], speed=10, tell=notes.append)
        for notes in told
    ]
    threads = [threading.Thread(target=bridge.run) for bridge in bridges]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    for bridge, notes in zip(bridges, told, strict=True):
        assert any(
            "another run has the prefix 'home', too: give each its own" in note for note in notes
        )
        assert bridge.counts["shared prefixes"] == 1


def test_an_unknown_host_of_a_broker_is_refused():
    with pytest.raises(InputError, match=r"mqtt://no\.such\.host\.invalid:1883: "):
        open_peer("mqtt://no.such.host.invalid")


# Brokers that misbehave


def answering(answer: Callable[[int, bytes], bytes]):
    """Return the port of a broker that answers each packet by its type and content."""

    def serve(connection: socket.socket):
        with connection, contextlib.suppress(OSError):
            while head := connection.recv(1):
                size, factor = 0, 1
                while (digit := connection.recv(1)[0]) & 128:
                    size, factor = size + (digit & 127) * factor, factor * 128
                size += digit * factor
                content = connection.recv(size, socket.MSG_WAITALL) if size else b""
                connection.sendall(answer(head[0] >> 4, content))

    def accept():
        while True:
            threading.Thread(target=serve, args=(listener.accept()[0],), daemon=True).start()

    listener = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=accept, daemon=True).start()
    return int(listener.getsockname()[1])


CONNECT, PUBLISH, SUBSCRIBE = 1, 3, 8
ACCEPTED = b"\x20\x02\x00\x00"


@pytest.mark.parametrize(
    ("code", "reason"),
    [(1, "Unsupported protocol version"), (4, "Bad user name or password"), (5, "Not authorized")],
)
def test_a_broker_that_refuses_is_not_connected(code, reason):
    port = answering(lambda kind, _: bytes([0x20, 2, 0, code]) if kind == CONNECT else b"")
    with pytest.raises(InputError) as caught:
        open_peer(f"mqtt://127.0.0.1:{port}/lab")
    assert str(caught.value) == (
        f"mqtt://127.0.0.1:{port}: the broker refuses the connection: {reason}"
    )


def test_a_broker_that_refuses_the_subscription_is_not_connected():
    def answer(kind, content):
        return ACCEPTED if kind == CONNECT else b"\x90\x03" + content[:2] + b"\x80"

    with pytest.raises(InputError, match="refuses the subscription to lab/in/#: Unspecified error"):
        open_peer(f"mqtt://127.0.0.1:{answering(answer)}/lab")


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 200 OK\r\n\r\nhello", ACCEPTED])
def test_a_server_that_is_no_broker_is_told(answer, monkeypatch):
    monkeypatch.setattr(peers, "WAIT_S", 0.5)
    port = answering(lambda kind, _: answer if kind == CONNECT else b"")
    with pytest.raises(InputError, match=r"nothing there answers within 0\.5 s as a broker does"):
        open_peer(f"mqtt://127.0.0.1:{port}/lab")


def test_user_and_password_of_an_address_are_sent():
    seen = []

    def answer(kind, content):
        seen.append(content)
        return b"\x20\x02\x00\x05"

    with pytest.raises(InputError, match="Not authorized") as caught:
        open_peer(f"mqtt://ana:s%40lt@127.0.0.1:{answering(answer)}/lab")
    assert seen[0].endswith(b"\x00\x03ana\x00\x04s@lt")
    assert "lt" not in str(caught.value)


@pytest.mark.slow
def test_a_broker_that_was_restarted_gets_all_that_it_keeps():
    published = []

    def answer(kind, content):
        if kind == CONNECT:
            published.append([])
            return ACCEPTED
        if kind == SUBSCRIBE:
            return b"\x90\x03" + content[:2] + b"\x01"
        if kind != PUBLISH:
            return b""
        size = int.from_bytes(content[:2])
        topic = content[2 : 2 + size].decode()
        published[-1].append(topic)
        if topic.endswith("/in/end"):
            raise OSError
        return b"\x40\x02" + content[2 + size : 4 + size]

    peer = open_peer(f"mqtt://127.0.0.1:{answering(answer)}/lab")
    peer._client.reconnect_delay_set(1, 1)
    bridge = Bridge(fleet2d.Simulation(LIVE), [peer], speed=5)
    thread = threading.Thread(target=bridge.run)
    thread.start()
    time.sleep(1)
    peer._client.publish("lab/in/end")
    thread.join()

    kept = {
        "lab/status",
        "lab/sensor/front_door",
        "homeassistant/binary_sensor/lab/front_door/config",
        "homeassistant/sensor/lab/ana/config",
        "homeassistant/sensor/lab/astro/config",
    }
    assert len(published) == 2
    assert all(kept <= set(topics) for topics in published)
    assert bridge.counts["lost connections"] == 1


@pytest.mark.slow
def test_messages_before_the_run_begins_are_kept():
    """A broker sends what it retains at once, while the simulation is still being made."""
    reading = b'{"type": "reading", "sensor": "front_door", "on": true}'
    retained = b"\x00\x08lab/in/x" + reading

    def answer(kind, content):
        if kind == CONNECT:
            return ACCEPTED
        if kind == SUBSCRIBE:
            return b"\x90\x03" + content[:2] + b"\x01\x31" + bytes([len(retained)]) + retained
        return b""

    peer = open_peer(f"mqtt://127.0.0.1:{answering(answer)}/lab")
    time.sleep(0.3)
    bridge = Bridge(fleet2d.Simulation(LIVE, "simulation.duration=3 s"), [peer], speed=0)
    bridge.run()

    assert bridge.counts == {"received": 1, "applied": 1}
