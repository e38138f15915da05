"""A node of ROS 2 that speaks the protocol of `rmw_zenoh`, without ROS.

The graph of ROS consists of liveliness tokens; topics, services and actions are keys that hold the
name and the hash of a type. The formats are those of rmw_zenoh's `docs/design.md`.
"""

import json
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

from fleet2d.errors import extra
from fleet2d.live.ros.node import LATCHED, USUAL, ActionGoal, Fields, Quality
from fleet2d.live.ros.types import RosTypes, wire_name
from fleet2d.live.ros.zenoh_action import ZenohAction

PORT = 7447
"""The port of zenoh's router."""
# Number of the message from 1, time [ns since 1970], size of the identifier, identifier.
_ATTACHMENT = struct.Struct("<qqB16s")
_ID_BYTES = 16
_DEFAULT_DEPTH = 42  # the default of rmw_zenoh
_HEARTBEAT_S = 0.5
_LOCAL = ("localhost", "127.0.0.1", "::1")


def _quality_text(quality: Quality) -> str:
    """Return a quality as rmw_zenoh writes it, with nothing for defaults."""
    depth = "" if quality.depth == _DEFAULT_DEPTH else quality.depth
    return f":{1 if quality.is_latched else ''}:,{depth}:,:,:,,"


class ZenohNode:
    """A node, alone in a session.

    Attributes:
        types: The types of messages.
        distribution: The version of ROS 2.
        notes: Empty, as it leaves nothing out.
        hears_several_types: Whether it can hear messages of several types on a topic.
        is_router: Whether it is the router of this machine, which had none.
    """

    hears_several_types = True

    def __init__(
        self, types: RosTypes, host: str = "localhost", port: int = PORT, *, domain: int = 0
    ) -> None:
        """Join the graph through the router at an address, or as the router of this machine.

        Where no router of another machine answers, the connection is tried again.

        Raises:
            InputError: eclipse-zenoh isn't installed.
        """
        with extra("ros2", "ros2:// needs eclipse-zenoh and xxhash"):
            import xxhash
            import zenoh
            from zenoh import ext

        self._zenoh: Any = zenoh
        self._ext: Any = ext
        self._xxhash: Any = xxhash
        self.types = types
        self.distribution = types.distribution
        self.notes: list[str] = []
        self._domain = domain
        self._session, self.is_router = self._open(host, port)
        self._id = str(self._session.info.zid())
        self._entities = 0
        self._kept: list[Any] = []  # a declaration ends with its last reference
        self._calls = 0
        self._declare_token("NN")

    def _open(self, host: str, port: int) -> tuple[Any, bool]:
        endpoint = f"tcp/{'127.0.0.1' if host in _LOCAL else host}:{port}"
        if host in (*_LOCAL, "0.0.0.0"):  # noqa: S104 - the user asked for it
            try:
                return self._zenoh.open(self._config("router", listens=endpoint)), True
            except self._zenoh.ZError:  # the port is taken, probably by a router
                endpoint = f"tcp/127.0.0.1:{port}"
        try:
            return self._zenoh.open(self._config("peer", connects=endpoint)), False
        except self._zenoh.ZError:
            self.notes.append(
                f"ros2://{host}:{port}: no router of zenoh answers there yet; it is tried again:"
                " start one, such as ros2 run rmw_zenoh_cpp rmw_zenohd"
            )
        return self._zenoh.open(self._config("peer", connects=endpoint, waits=False)), False

    def _config(
        self, mode: str, *, listens: str = "", connects: str = "", waits: bool = True
    ) -> Any:
        config = self._zenoh.Config()
        values: dict[str, Any] = {
            "mode": mode,
            "connect/endpoints": [connects] if connects else [],
            "connect/timeout_ms": 3000 if waits else -1,
            "connect/exit_on_failure": waits,
            "listen/endpoints": [listens or "tcp/127.0.0.1:0"],
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": True,
            "timestamping/enabled": {"router": True, "peer": True, "client": True},
        }
        for key, value in values.items():
            config.insert_json5(key, json.dumps(value))
        return config

    def _declare_token(
        self, kind: str, name: str = "", of: str = "", quality: Quality | None = None
    ) -> str:
        """Declare an entity in the graph.

        The kinds are NN: node, MP: publisher, MS: subscription, SS: service, SC: client.
        """
        parts = ["@ros2_lv", self._domain, self._id, 0, self._entities, kind, "%", "%", "fleet2d"]
        if quality is not None:
            typed = [wire_name(of), self.types.hash(of), _quality_text(quality)]
            parts += [name.replace("/", "%"), *typed]
        self._entities += 1
        token = "/".join(map(str, parts))
        self._kept.append(self._session.liveliness().declare_token(token))
        return token

    def _identifier(self, token: str) -> bytes:
        value = self._xxhash.xxh3_128_intdigest(token.encode())
        return struct.pack("<QQ", value & (2**64 - 1), value >> 64)

    def _key(self, name: str, of: str) -> str:
        return f"{self._domain}/{name.strip('/')}/{wire_name(of)}/{self.types.hash(of)}"

    def publisher(self, name: str, of: str, quality: Quality = USUAL) -> Callable[[Fields], None]:
        """Return a function that publishes a message."""
        identifier = self._identifier(self._declare_token("MP", name, of, quality))
        more: dict[str, Any] = {}
        if quality.is_latched:
            detection = self._ext.MissDetectionConfig(sporadic_heartbeat=_HEARTBEAT_S)
            more = {
                "cache": self._ext.CacheConfig(quality.depth),
                "publisher_detection": True,
                "sample_miss_detection": detection,
            }
        declared = self._ext.declare_advanced_publisher(
            self._session,
            self._key(name, of),
            reliability=self._zenoh.Reliability.RELIABLE,
            congestion_control=self._zenoh.CongestionControl.DROP,
            **more,
        )
        lock = threading.Lock()
        count = 0

        def publish(fields: Fields) -> None:
            nonlocal count
            data = self.types.encode(of, fields)
            with lock:
                count += 1
                head = _ATTACHMENT.pack(count, time.time_ns(), _ID_BYTES, identifier)
                declared.put(data, attachment=head)

        return publish

    def subscribe(
        self,
        name: str,
        of: str,
        heard: Callable[[dict[str, Any]], None],
        wrong: Callable[[str], None],
        quality: Quality = USUAL,
    ) -> None:
        """Call a function with each message of a topic."""
        more: dict[str, Any] = {}
        if quality.is_latched:
            more = {
                "history": self._ext.HistoryConfig(
                    detect_late_publishers=True, max_samples=quality.depth
                ),
                "subscriber_detection": True,
                "recovery": self._ext.RecoveryConfig(heartbeat=True),
            }

        def receive(sample: Any) -> None:
            try:
                fields = self.types.decode(of, sample.payload.to_bytes())
            except ValueError as error:
                wrong(str(error))
            else:
                heard(fields)

        key = self._key(name, of)
        declared = self._ext.declare_advanced_subscriber(self._session, key, receive, **more)
        self._kept.append(declared)
        self._declare_token("MS", name, of, quality)

    def serve(
        self, name: str, of: str, answer: Callable[[dict[str, Any], Callable[[Fields], None]], None]
    ) -> None:
        """Serve a service by `answer(request, reply)`, which calls `reply(response)` in time."""
        key = self._key(name, of)

        def handle(query: Any) -> None:
            try:
                number, _, _, client = _ATTACHMENT.unpack(query.attachment.to_bytes())
                request = self.types.decode(f"{of}_Request", query.payload.to_bytes())
            except (AttributeError, struct.error, ValueError):
                return  # the query is no call of ROS

            def reply(response: Fields) -> None:
                head = _ATTACHMENT.pack(number, time.time_ns(), _ID_BYTES, client)
                with query:
                    data = self.types.encode(f"{of}_Response", response)
                    query.reply(key, data, attachment=head)

            answer(request, reply)

        self._kept.append(self._session.declare_queryable(key, handle, complete=True))
        self._declare_token("SS", name, of, USUAL)

    def action(
        self,
        name: str,
        of: str,
        begin: Callable[[ActionGoal], bool],
        cancel: Callable[[ActionGoal], None],
        stamp: Callable[[], Fields],
    ) -> ZenohAction:
        """Serve an action."""
        parts = f"{name}/_action"
        feedback = self.publisher(f"{parts}/feedback", f"{of}_FeedbackMessage")
        states = self.publisher(f"{parts}/status", "action_msgs/msg/GoalStatusArray", LATCHED)
        action = ZenohAction(feedback, states, begin, cancel, stamp)
        self.serve(f"{parts}/send_goal", f"{of}_SendGoal", action.accept)
        self.serve(f"{parts}/get_result", f"{of}_GetResult", action.tell_result)
        self.serve(f"{parts}/cancel_goal", "action_msgs/srv/CancelGoal", action.cancel)
        return action

    def call(self, name: str, of: str, request: Fields, timeout_s: float = 10.0) -> dict[str, Any]:
        """Call a service, and wait for its response.

        Raises:
            TimeoutError: Nobody answers.
        """
        identifier = self._identifier(self._declare_token("SC", name, of, USUAL))
        self._calls += 1
        replies = self._session.get(
            self._key(name, of),
            target=self._zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=self._zenoh.ConsolidationMode.NONE,
            payload=self.types.encode(f"{of}_Request", request),
            attachment=_ATTACHMENT.pack(self._calls, time.time_ns(), _ID_BYTES, identifier),
            timeout=timeout_s,
        )
        for reply in replies:
            if reply.ok is not None:
                return self.types.decode(f"{of}_Response", reply.ok.payload.to_bytes())
        raise TimeoutError(f"{name}: nobody answers within {timeout_s:g} s")

    def entities(self) -> list[str]:
        """Return the tokens of all entities of the domain."""
        found = self._session.liveliness().get(f"@ros2_lv/{self._domain}/**", timeout=2.0)
        return sorted(str(reply.ok.key_expr) for reply in found if reply.ok is not None)

    def close(self) -> None:
        """Leave the graph; without it the process wouldn't end."""
        self._session.close()
