"""MQTT: a real broker and a real client; Home Assistant finds sensors and bodies."""

import json
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.live.scenes import LIVE, place

import fleet2d
from fleet2d.errors import InputError
from fleet2d.live import Bridge, open_peer

pytest.importorskip("paho.mqtt.client", reason="the extra mqtt is not installed")
BROKER = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")


@pytest.fixture
def mosquitto(tmp_path: Path) -> Iterator[tuple[int, "subprocess.Popen[bytes]"]]:
    """Start Mosquitto on a free port."""
    if BROKER is None:
        pytest.skip("mosquitto is not installed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    config = tmp_path / "mosquitto.conf"
    config.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    process = subprocess.Popen([BROKER, "-c", str(config)], stderr=subprocess.DEVNULL)
    try:
        for _ in range(100):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.05)
        yield port, process
    finally:
        process.terminate()
        process.wait()


@pytest.fixture
def broker(mosquitto: tuple[int, "subprocess.Popen[bytes]"]) -> int:
    return mosquitto[0]


class Client:
    """A client that keeps what it hears."""

    def __init__(self, port: int) -> None:
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

    def of(self, topic: str) -> list[str]:
        return [payload for name, payload in self.heard if name == topic]

    def close(self) -> None:
        self.mqtt.disconnect()
        self.mqtt.loop_stop()
        self.mqtt.on_message = self.mqtt.on_subscribe = None
        del self.mqtt  # closes its sockets


def test_a_broker_passes_on_what_happens_and_what_arrives(broker: int) -> None:
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


def test_goals_are_withdrawn_when_the_broker_is_gone(
    mosquitto: tuple[int, "subprocess.Popen[bytes]"],
) -> None:
    port, process = mosquitto
    peer = open_peer(f"mqtt://127.0.0.1:{port}/home")
    told: list[str] = []
    bridge = Bridge(fleet2d.Simulation(LIVE), [peer], speed=10, tell=told.append)
    thread = threading.Thread(target=bridge.run)
    thread.start()
    client = Client(port)
    goal = {"type": "goal", "entity": "astro", "to": "kitchen_0"}
    client.mqtt.publish("home/in/any", json.dumps(goal), qos=1).wait_for_publish(5)
    while thread.is_alive() and not bridge.counts["applied"]:
        time.sleep(0.01)
    process.kill()
    thread.join()
    client.close()

    assert told == ["astro: who sent it to kitchen_0 is gone: the goal is withdrawn"]


def test_no_broker_is_told() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match=f"mqtt://127.0.0.1:{port}: there is no broker"):
        open_peer(f"mqtt://127.0.0.1:{port}")
