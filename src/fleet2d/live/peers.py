"""Other programs of a live run: Python functions, UDP, WebSocket, MQTT; any by its address.

A network peer is written `scheme://host:port`. The run waits for no peer: a slow one loses
messages, and one that is gone is left out.
"""

import contextlib
import itertools
import json
import queue
import re
import socket
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from http import HTTPStatus
from typing import Any
from urllib.parse import unquote

from pydantic_core import PydanticCustomError

from fleet2d.bounds import one_line
from fleet2d.configuration.units import parse_peer_address
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.sensor import Sensor
from fleet2d.errors import InputError, errors_as, extra, os_errors_as, printable
from fleet2d.live.bridge import LiveStep, Peer, PeerFault, Post, lose, missing, sources_of
from fleet2d.live.goals import GoalStatus
from fleet2d.live.messages import MAX_BYTES
from fleet2d.runs.run import Run
from fleet2d.runtime.events import EventKind
from fleet2d.scenario.model import Scenario

# The length of a client's queue above which the client is disconnected as too slow.
MAX_QUEUE = 10_000
# Programs have no origin; of pages, which any site could open in a browser, only those of this
# machine are allowed.
ORIGINS = [None, re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")]
THIS_MACHINE = (None, "localhost", "127.0.0.1", "::1")
VERSION = 1
"""The version of the messages."""

DISCOVERY = "homeassistant"
DEVICE_CLASSES = {
    "motion_sensor": "motion",
    "contact_sensor": "door",
    "occupancy_sensor": "occupancy",
    "smart_plug": "power",
}
"""Home Assistant's class of each type of sensor."""
WAIT_S = 5.0
# The number of senders of datagrams that get the states of goals.
MAX_SENDERS = 16
# The number of messages kept before a run, and for a broker that is gone.
MAX_EARLY = 1000


class FunctionPeer(Peer):
    """A Python function that is called with each frame, or an iterator of messages."""

    def __init__(
        self,
        function: Callable[[LiveStep], object] = id,
        messages: Iterable[Mapping[str, Any]] = (),
    ) -> None:
        """Wrap a function, and messages that are read in a thread of their own."""
        self._function = function
        self._messages = messages

    def open(self, simulation: Simulation, post: Post) -> None:
        """Begin to read the messages."""

        def read() -> None:
            for message in self._messages:
                post(message)

        if self._messages != ():
            threading.Thread(target=read, daemon=True).start()

    def send(self, frame: LiveStep) -> None:
        """Call the function."""
        self._function(frame)


def to_function(function: Callable[[LiveStep], object]) -> FunctionPeer:
    """Return a peer that calls a function with each frame, in the thread of the run."""
    return FunctionPeer(function)


def from_iterator(messages: Iterable[Mapping[str, Any]]) -> FunctionPeer:
    """Return a peer that sends the messages of an iterator, which may wait between them."""
    return FunctionPeer(messages=messages)


def hello(simulation: Simulation) -> dict[str, Any]:
    """Return the first message to a program, which describes the run."""
    scenario = simulation.scenario
    return {
        "type": "hello",
        "version": VERSION,
        "start": simulation.clock.start.isoformat(),
        "step_s": simulation.clock.step_us / 1e6,
        "users": list(scenario.users),
        "robots": list(scenario.robots),
        "objects": list(scenario.objects),
        "rooms": [
            {"name": room.name, "type": room.type, "x": room.anchor_xy[0], "y": room.anchor_xy[1]}
            for room in simulation.home.rooms
        ],
    }


class UdpPeer(Peer):
    """Messages in datagrams, one JSON object each; senders get the states of goals."""

    def __init__(self, host: str, port: int) -> None:
        """Listen at an address; port 0 is a free one."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise InputError(f"udp://{host}:{port}: {error.strerror or error}") from error
        self._socket.settimeout(0.2)
        self._over = False
        self._senders: deque[Any] = deque(maxlen=MAX_SENDERS)  # their addresses, the latest last

    @property
    def port(self) -> int:
        """The port at which it listens."""
        return int(self._socket.getsockname()[1])

    def open(self, simulation: Simulation, post: Post) -> None:
        """Begin to receive."""
        threading.Thread(target=self._receive, args=(post,), daemon=True).start()

    def _receive(self, post: Post) -> None:
        while not self._over:
            with contextlib.suppress(TimeoutError, OSError):
                content, address = self._socket.recvfrom(MAX_BYTES)
                if address not in self._senders:
                    self._senders.append(address)
                post(content)

    def send(self, frame: LiveStep) -> None:
        """Tell the latest senders which goals begin and end."""
        news = [goal for goal in frame.goals if goal.state != GoalStatus.UNDER_WAY]
        for address, goal in itertools.product(tuple(self._senders), news):
            with contextlib.suppress(OSError):
                self._socket.sendto(goal.text().encode(), address)

    def close(self, run: Run) -> None:
        """Stop listening."""
        self._over = True
        self._socket.close()


class WebSocketPeer(Peer):
    """A WebSocket server: clients get poses and events as JSON, and may send messages."""

    def __init__(self, host: str, port: int) -> None:
        """Serve at an address; port 0 is a free one.

        Raises:
            InputError: The address can't be used, or websockets isn't installed.
        """
        with extra("live", "ws:// needs websockets"):
            from websockets.sync.server import serve

        with os_errors_as(InputError, f"ws://{host}:{port}"):
            self._server = serve(
                self._serve,
                host,
                port,
                max_size=MAX_BYTES,
                origins=ORIGINS,
                process_response=self._tell_refusal,
                open_timeout=WAIT_S,
                close_timeout=WAIT_S,
            )
        self._address = f"ws://{host}:{self.port}"
        self._clients: dict[Any, queue.Queue[str | None]] = {}
        self._lock = threading.Lock()
        self._hello = ""
        self._numbers = itertools.count()
        self._end: tuple[str | None, ...] = ()
        self._post: Post

    @property
    def port(self) -> int:
        """The port at which it serves."""
        return int(self._server.socket.getsockname()[1])

    def open(self, simulation: Simulation, post: Post) -> None:
        """Begin to serve."""
        self._hello = json.dumps(hello(simulation))
        self._post = post
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def _serve(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        texts: queue.Queue[str | None] = queue.Queue(MAX_QUEUE)
        number = next(self._numbers)
        try:
            texts.put(self._hello)
            with self._lock:
                self._clients[connection] = texts
                for text in self._end:
                    texts.put(text)
            sender = threading.Thread(target=self._pass_on, args=(connection, texts), daemon=True)
            sender.start()
            for content in connection:
                self._post(content, number)
        except ConnectionClosed as error:
            self._post(PeerFault("lost connections", f"a client of {self._address}: {error}"))
        self._post(None, number)
        self._forget(connection)

    def _tell_refusal(self, _: Any, request: Any, response: Any) -> None:
        if response.status_code != HTTPStatus.SWITCHING_PROTOCOLS:
            text = printable(one_line(response.body.decode(errors="replace"), 200))
            self._post(PeerFault("refused clients", f"{self._address}: {text}"))

    def _pass_on(self, connection: Any, texts: "queue.Queue[str | None]") -> None:
        from websockets.exceptions import ConnectionClosed

        with contextlib.suppress(ConnectionClosed):
            while (text := texts.get()) is not None:
                connection.send(text)
            connection.close()

    def _forget(self, connection: Any) -> None:
        with self._lock:
            texts = self._clients.pop(connection, None)
        if texts is not None:
            with contextlib.suppress(queue.Full):
                texts.put_nowait(None)

    def _put(self, texts: Iterable[str | None]) -> None:
        with self._lock:
            clients = list(self._clients.items())
        for connection, waiting in clients:
            try:
                for text in texts:
                    waiting.put_nowait(text)
            except queue.Full:  # too slow: it is disconnected, and the run goes on
                text = f"a client of {self._address} doesn't read: it is disconnected"
                self._post(PeerFault("slow clients", text))
                self._forget(connection)
                _cut(connection)

    def send(self, frame: LiveStep) -> None:
        """Pass a frame on to all clients."""
        if self._clients:
            self._put(frame.texts)

    def tell(self, text: str) -> None:
        """Pass a note on to all clients."""
        self._put([json.dumps({"type": "note", "text": text})])

    def close(self, run: Run) -> None:
        """Tell the end to all clients, and disconnect them."""
        end = {"type": "end", "status": run.status, "digest": run.digest}
        with self._lock:  # clients may be connecting
            self._end = json.dumps(end), None
        self._put(self._end)
        until = time.monotonic() + WAIT_S
        while self._clients and time.monotonic() < until:
            time.sleep(0.01)
        for connection in list(self._clients):
            _cut(connection)
        self._server.shutdown()


def _cut(connection: Any) -> None:
    """End a connection without closing it, which would wait for a client that doesn't read."""
    with contextlib.suppress(OSError):
        connection.socket.shutdown(socket.SHUT_RDWR)


def open_peer(address: str) -> Peer:
    """Return a peer by its address.

    Args:
        address: `udp://HOST:PORT` and `ws://HOST:PORT` listen there; `rosbridge://HOST:PORT` and
            `mqtt://USER:PASSWORD@HOST:PORT/PREFIX` connect to a rosbridge server and a broker;
            `ros2://HOST:PORT/DISTRIBUTION/ROBOT` joins the graph of ROS 2, all parts optional.

    Raises:
        InputError: There is no such scheme, the address can't be used, or an extra isn't installed.

    Example:
        >>> open_peer("wss://here:1")
        Traceback (most recent call last):
        fleet2d.errors.InputError: 'wss://here:1' is not the address of a peer: did you mean 'ws'? \
Write udp://HOST:PORT, ws://HOST:PORT, rosbridge://HOST:PORT, mqtt://HOST:PORT/PREFIX or ros2://
    """
    with errors_as(InputError, of=PydanticCustomError):
        parts = parse_peer_address(address)
    host = parts.hostname or "127.0.0.1"
    port = parts.port
    if parts.scheme == "udp":
        return UdpPeer(host, port or 0)
    if parts.scheme == "ws":
        return WebSocketPeer(host, port or 0)
    if parts.scheme == "rosbridge":
        from fleet2d.live.ros.rosbridge import RosbridgePeer

        return RosbridgePeer(host, port or 9090)
    if parts.scheme == "ros2":
        from fleet2d.live.ros.ros2 import Ros2Peer

        return Ros2Peer(parts.hostname or "localhost", port, parts.path)

    names = [None if part is None else unquote(part) for part in (parts.username, parts.password)]
    return MqttPeer(host, port or 1883, parts.path.strip("/") or "fleet2d", *names)


def open_peers(scenario: Scenario, *addresses: str) -> dict[str, Peer]:
    """Return the peers of a live run by their addresses: those given, and the scenario's sources.

    Raises:
        InputError: as `open_peer`; or the scenario names a source on another machine, and
            `addresses` doesn't.
    """
    sources = dict.fromkeys(sources_of(scenario).values())
    for source in sources:
        is_here = parse_peer_address(source).hostname in THIS_MACHINE
        if source not in addresses and not is_here:
            raise InputError(
                f"the scenario would talk to {source}, another machine: name it by --with, too"
            )
    return {address: open_peer(address) for address in dict.fromkeys([*addresses, *sources])}


class MqttPeer(Peer):
    """A broker of MQTT.

    Attributes:
        prefix: The beginning of all topics of the run.
    """

    def __init__(
        self,
        host: str,
        port: int,
        prefix: str,
        user: str | None = None,
        password: str | None = None,
    ) -> None:
        """Connect to a broker; where none listens yet, the connection is tried again.

        Raises:
            InputError: There is no such machine, the broker refuses, or it doesn't answer; or
                paho-mqtt isn't installed.
        """
        with extra("mqtt", "mqtt:// needs paho-mqtt"):
            from paho.mqtt.client import Client
            from paho.mqtt.enums import CallbackAPIVersion

        self.prefix = prefix
        self._address = f"mqtt://{host}:{port}"
        self._retained: dict[str, str] = {}  # a restarted broker has lost these
        self._on: dict[str, str] = {}  # each sensor's word for on
        self._answers: queue.SimpleQueue[str] = queue.SimpleQueue()  # refusals, or ""
        self._post: Post | None = None
        # Messages that arrive before the run begins.
        self._early: deque[bytes | PeerFault] = deque(maxlen=MAX_EARLY)
        self._client: Any = Client(CallbackAPIVersion.VERSION2)
        self._client.max_queued_messages_set(MAX_EARLY)  # while there is no broker
        self._client.username_pw_set(user, password)
        self._client.will_set(f"{prefix}/status", "offline", retain=True)
        self._client.on_connect = self._greet
        self._client.on_subscribe = self._subscribed
        self._client.on_message = lambda *args: self._receive(args[-1])
        self._name = uuid.uuid4().hex.encode()  # tells runs of one prefix apart
        self._others = {self._name}
        self._is_missing = False
        try:
            self._client.connect(host, port)
        except (ConnectionError, TimeoutError):
            self._is_missing = True
            self._client.connect_async(host, port)
        except OSError as error:
            raise InputError(f"{self._address}: {error.strerror or error}") from error
        self._client.loop_start()
        if not self._is_missing:
            self._await_answer()

    def _await_answer(self) -> None:
        """Wait until the broker takes the subscription.

        Raises:
            InputError: The broker refuses, or doesn't answer.
        """
        try:
            refusal = self._answers.get(timeout=WAIT_S)
        except queue.Empty:
            refusal = f"nothing there answers within {WAIT_S:g} s as a broker does"
        if refusal:
            self._client.disconnect()
            self._client.loop_stop()
            raise InputError(f"{self._address}: {refusal}")

    def _greet(self, *arguments: Any) -> None:
        """Subscribe, and publish the retained messages, at each connection."""
        if (reason := arguments[3]).is_failure:
            self._answer(f"the broker refuses the connection: {reason}")
            return
        self._client.subscribe(f"{self.prefix}/in/#", qos=1)
        self._client.publish(self._meeting, self._name)
        for topic, text in list(self._retained.items()):
            self._client.publish(topic, text, qos=1, retain=True)

    @property
    def _meeting(self) -> str:
        """The topic at which runs of one prefix notice each other."""
        return f"{self.prefix}/in/run"

    def _meet(self, name: bytes) -> None:
        """Report another run with this prefix, and let it notice this one."""
        if name in self._others or len(self._others) > MAX_SENDERS:
            return
        self._others.add(name)
        self._client.publish(self._meeting, self._name)
        text = f"another run has the prefix {self.prefix!r}, too: give each its own, as in"
        advice = "mqtt://HOST/first and mqtt://HOST/second"
        self._hear(PeerFault("shared prefixes", f"{self._address}: {text} {advice}"))

    def _subscribed(self, *arguments: Any) -> None:
        refused = [reason for reason in arguments[3] if reason.is_failure]
        text = f"the broker refuses the subscription to {self.prefix}/in/#"
        self._answer(f"{text}: {refused[0]}" if refused else "")

    def _receive(self, message: Any) -> None:
        if message.topic == self._meeting:
            self._meet(message.payload)
        else:
            self._hear(message.payload)

    def _hear(self, content: bytes | PeerFault) -> None:
        if self._post is None:
            self._early.append(content)
        else:
            self._post(content)

    def _answer(self, refusal: str) -> None:
        """Pass on the answer of the broker: to the constructor, or to the run."""
        if self._post is None:
            self._answers.put(refusal)
        elif refusal:
            self._post(PeerFault("lost connections", f"{self._address}: {refusal}"))

    def open(self, simulation: Simulation, post: Post) -> None:
        """Announce the sensors and bodies, and begin to receive."""
        self._post = post
        while self._early:
            post(self._early.popleft())
        if self._is_missing:
            post(missing(self._address, "broker"))
        self._client.on_disconnect = lambda *_: lose(post, self._address)
        for name, item in simulation.scenario.objects.items():
            if isinstance(item, Sensor):
                self._on[name] = item.words[0]
                config: dict[str, Any] = {"payload_on": "ON", "payload_off": "OFF"}
                if item.type_name in DEVICE_CLASSES:
                    config["device_class"] = DEVICE_CLASSES[item.type_name]
                self._announce("binary_sensor", name, f"sensor/{name}", config)
                self._retain(f"{self.prefix}/sensor/{name}", "OFF")
        for name in simulation.actors:
            template = {"value_template": "{{ value_json.room or 'away' }}"}
            self._announce("sensor", name, f"pose/{name}", template)
        self._retain(f"{self.prefix}/status", "online")

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
        # Home Assistant takes ASCII only; the numbers of other letters keep names distinct.
        place = re.sub(r"[^A-Za-z0-9_-]", lambda letter: f"_{ord(letter[0]):x}", name)
        self._retain(f"{DISCOVERY}/{component}/{node}/{place}/config", json.dumps(content))

    def _retain(self, topic: str, text: str) -> None:
        """Publish a message that the broker retains."""
        self._retained[topic] = text
        self._client.publish(topic, text, qos=1, retain=True)

    def _publish(self, topic: str, text: str) -> None:
        self._client.publish(f"{self.prefix}/{topic}", text)

    def send(self, frame: LiveStep) -> None:
        """Publish a frame."""
        for name, body in frame.bodies.items():
            self._publish(f"pose/{name}", json.dumps({**body, "step": frame.step}))
        for event in frame.events:
            if event.event == EventKind.SENSOR:
                state = "ON" if event.detail == self._on.get(event.entity) else "OFF"
                self._retain(f"{self.prefix}/sensor/{event.entity}", state)
            self._publish("event", json.dumps({**event._asdict(), "event": str(event.event)}))
        for goal in frame.goals:
            self._publish(f"goal/{goal.entity}", goal.text())
        for table, row in frame.rows:
            self._publish(f"row/{table}", json.dumps(row, default=str))

    def tell(self, text: str) -> None:
        """Publish a note about messages."""
        self._publish("note", text)

    def close(self, run: Run) -> None:
        """Publish that the run is over, and disconnect."""
        self._retained[f"{self.prefix}/status"] = "offline"
        message = self._client.publish(f"{self.prefix}/status", "offline", qos=1, retain=True)
        if self._client.is_connected():
            message.wait_for_publish(WAIT_S)
        self._client.disconnect()
        self._client.loop_stop()
