"""MQTT: poses, events and sensors to a broker, found by Home Assistant; messages from it.

Topics, below a prefix: `pose/NAME`, `event`, `row/TABLE`, `sensor/NAME` (ON, OFF), `note`, `status`
(online, offline); messages to the run come by `in/#`. Sensors, and the room of each body, announce
themselves by Home Assistant's discovery.
"""

import json
import re
import threading
from typing import Any

from fleet2d.engine.simulation import Simulation
from fleet2d.entities.home_object import Sensor
from fleet2d.errors import InputError, extra
from fleet2d.live.bridge import LiveStep, Post
from fleet2d.runs.run import Run
from fleet2d.runtime.events import EventKind

DISCOVERY = "homeassistant"
DEVICE_CLASSES = {
    "motion_sensor": "motion",
    "contact_sensor": "door",
    "occupancy_sensor": "occupancy",
    "smart_plug": "power",
}
"""Home Assistant's class of each type of sensor."""
WAIT_S = 5.0


class MqttPeer:
    """A broker of MQTT.

    Attributes:
        prefix: The beginning of all topics of the run.
    """

    def __init__(self, host: str, port: int, prefix: str) -> None:
        """Connect to a broker.

        Raises:
            InputError: There is no broker at the address, or paho-mqtt isn't installed.
        """
        with extra("mqtt", "mqtt:// needs paho-mqtt"):
            from paho.mqtt.client import Client
            from paho.mqtt.enums import CallbackAPIVersion

        self.prefix = prefix
        self._client: Any = Client(CallbackAPIVersion.VERSION2)
        self._client.will_set(f"{prefix}/status", "offline", retain=True)
        self._is_on = threading.Event()
        self._client.on_connect = self._subscribe
        try:
            self._client.connect(host, port)
        except OSError as error:
            raise InputError(
                f"mqtt://{host}:{port}: there is no broker: {error.strerror or error}"
            ) from error
        self._client.loop_start()
        if not self._is_on.wait(WAIT_S):
            self._client.loop_stop()
            raise InputError(f"mqtt://{host}:{port}: the broker doesn't answer")
        self._on: dict[str, str] = {}  # the word of each sensor for being on

    def _subscribe(self, *_: object) -> None:
        self._is_on.set()
        self._client.subscribe(f"{self.prefix}/in/#", qos=1)

    def open(self, simulation: Simulation, post: Post) -> None:
        """Announce the sensors and bodies, and begin to receive."""
        self._client.on_message = lambda *args: post(args[-1].payload)
        self._client.on_disconnect = lambda *_: post(None)
        for name, item in simulation.scenario.objects.items():
            if isinstance(item, Sensor):
                self._on[name] = item.words[0]
                config: dict[str, Any] = {"payload_on": "ON", "payload_off": "OFF"}
                if item.type_name in DEVICE_CLASSES:
                    config["device_class"] = DEVICE_CLASSES[item.type_name]
                self._announce("binary_sensor", name, f"sensor/{name}", config)
                self._publish(f"sensor/{name}", "OFF", retain=True)
        for name in simulation.actors:
            template = {"value_template": "{{ value_json.room or 'away' }}"}
            self._announce("sensor", name, f"pose/{name}", template)
        self._publish("status", "online", retain=True)

    def _announce(self, component: str, name: str, topic: str, config: dict[str, Any]) -> None:
        """Publish a configuration of Home Assistant's discovery."""
        node = re.sub(r"\W", "_", self.prefix)
        content = {
            "name": name,
            "unique_id": f"{node}_{name}",
            "state_topic": f"{self.prefix}/{topic}",
            "availability_topic": f"{self.prefix}/status",
            "device": {"identifiers": [node], "name": "Fleet2D", "manufacturer": "Fleet2D"},
            **config,
        }
        path = f"{DISCOVERY}/{component}/{node}/{re.sub(r'[^A-Za-z0-9_-]', '_', name)}/config"
        self._client.publish(path, json.dumps(content), qos=1, retain=True)

    def _publish(self, topic: str, text: str, *, retain: bool = False) -> None:
        self._client.publish(f"{self.prefix}/{topic}", text, qos=1 if retain else 0, retain=retain)

    def send(self, frame: LiveStep) -> None:
        """Publish a frame."""
        for name, body in frame.bodies.items():
            self._publish(f"pose/{name}", json.dumps({**body, "step": frame.step}))
        for event in frame.events:
            if event.event == EventKind.SENSOR:
                state = "ON" if event.detail == self._on.get(event.entity) else "OFF"
                self._publish(f"sensor/{event.entity}", state, retain=True)
            self._publish("event", json.dumps({**event._asdict(), "event": str(event.event)}))
        for table, row in frame.rows:
            self._publish(f"row/{table}", json.dumps(row, default=str))

    def tell(self, text: str) -> None:
        """Publish a note about what arrived."""
        self._publish("note", text)

    def close(self, run: Run) -> None:
        """Publish that the run is over, and disconnect."""
        message = self._client.publish(f"{self.prefix}/status", "offline", qos=1, retain=True)
        if self._client.is_connected():
            message.wait_for_publish(WAIT_S)
        self._client.disconnect()
        self._client.loop_stop()
