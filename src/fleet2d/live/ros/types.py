"""Types of ROS 2 without ROS: messages as mappings to CDR and back, and the hashes of REP 2016.

The library rosbags has the types and CDR. It hashes messages only: the types that rosidl derives
from services and actions are registered here as messages.
"""

from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np

from fleet2d.errors import InputError, extra
from fleet2d.storage.bags import VISION_TYPES

DISTRIBUTIONS = ("humble", "jazzy", "kilted", "lyrical")
"""The versions of ROS 2 whose wire formats are known."""
NAVIGATE = "nav2_msgs/action/NavigateToPose"
UUID = "unique_identifier_msgs/msg/UUID"

PEOPLE_TYPES = {
    "people_msgs/msg/Person": (
        "string name\ngeometry_msgs/Point position\ngeometry_msgs/Point velocity\n"
        "float64 reliability\nstring[] tagnames\nstring[] tags\n"
    ),
    "people_msgs/msg/People": "std_msgs/Header header\npeople_msgs/Person[] people\n",
}
"""The definitions of people_msgs, to which programs of social navigation subscribe."""

_EVENT_INFO = {
    "service_msgs/msg/ServiceEventInfo": (
        "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\n"
        "int64 sequence_number\n"
    )
}
_NAVIGATE_GOAL = "geometry_msgs/PoseStamped pose\nstring behavior_tree\n---\n"
_NAVIGATE_FEEDBACK = (
    "---\ngeometry_msgs/PoseStamped current_pose\nbuiltin_interfaces/Duration navigation_time\n"
    "builtin_interfaces/Duration estimated_time_remaining\nint16 number_of_recoveries\n"
    "float32 distance_remaining\n"
)
_NAVIGATE_RESULT = "uint16 error_code\nstring error_msg\n"
_NAVIGATE_ERRORS = "float32 position_tracking_error\nfloat32 heading_tracking_error\n"
_CANCEL = """action_msgs/GoalInfo goal_info
---
int8 return_code
action_msgs/GoalInfo[] goals_canceling
"""
# IDL has no structure without fields.
_PADDING = "structure_needs_at_least_one_member"
_TEXTS = ("string", "wstring")
_ZEROS = {"bool": False, "float32": 0.0, "float64": 0.0}


def navigate_definition(distribution: str) -> str:
    """Return the definition of the action NavigateToPose of a distribution, without constants."""
    if distribution == "humble":
        return f"{_NAVIGATE_GOAL}std_msgs/Empty result\n{_NAVIGATE_FEEDBACK}"
    errors = _NAVIGATE_ERRORS if distribution == "lyrical" else ""
    return f"{_NAVIGATE_GOAL}{_NAVIGATE_RESULT}{_NAVIGATE_FEEDBACK}{errors}"


class MessageEncoder:
    """Serializes messages that are mappings of their fields, by a store of types of rosbags."""

    def __init__(self, store: Any) -> None:
        """Wrap a store; types may be added to it later."""
        from rosbags.interfaces import Nodetype

        self._store = store
        self._nodes: Any = Nodetype
        self._converter = cache(self._make_converter)

    def encode(self, name: str, fields: Mapping[str, Any]) -> bytes:
        """Return a message as CDR, with its header; fields that are left out are 0 or empty.

        Raises:
            KeyError: The type has no such field.
        """
        return bytes(self._store.serialize_cdr(self._converter(name)(fields), name))

    def _make_converter(self, name: str) -> Callable[[Mapping[str, Any]], Any]:
        """Return a function that makes a message of a type from a mapping."""
        cls = self._store.types[name]
        parts = {field: self._converter_of(kind) for field, kind in self._store.fielddefs[name][1]}
        blank = {field: partial(convert, None) for field, convert in parts.items()}

        def convert(fields: Mapping[str, Any] | None) -> Any:
            given = {field: parts[field](value) for field, value in (fields or {}).items()}
            rest = {field: make() for field, make in blank.items() if field not in given}
            return cls(**given, **rest)

        return convert

    def _converter_of(self, kind: Any) -> Callable[[Any], Any]:
        """Return a function that makes a field from its value, or its default from None."""
        node, rest = kind
        if node == self._nodes.NAME:
            return lambda value: self._converter(rest)(value)
        if node == self._nodes.BASE:
            zero = "" if rest[0] in _TEXTS else _ZEROS.get(rest[0], 0)
            return lambda value: zero if value is None else value
        item, count = rest
        length = count if node == self._nodes.ARRAY else 0
        if item[0] == self._nodes.BASE and item[1][0] not in _TEXTS:
            dtype = np.dtype({"octet": "uint8"}.get(item[1][0], item[1][0]))
            return lambda value: (
                np.zeros(length, dtype) if value is None else np.asarray(value, dtype)
            )
        convert = self._converter_of(item)
        return lambda value: [
            convert(part) for part in ([None] * length if value is None else value)
        ]


class RosTypes:
    """The types of a distribution of ROS 2, with those that Fleet2D adds.

    Attributes:
        distribution: Its name.

    Example:
        >>> types = RosTypes("jazzy")
        >>> data = types.encode("std_msgs/msg/String", {"data": "hello"})
        >>> types.decode("std_msgs/msg/String", data)
        {'data': 'hello'}
    """

    def __init__(self, distribution: str = "jazzy") -> None:
        """Collect the types of a distribution.

        Raises:
            InputError: The distribution is unknown, or rosbags isn't installed.
        """
        if distribution not in DISTRIBUTIONS:
            known = ", ".join(DISTRIBUTIONS)
            raise InputError(f"ROS 2 {distribution!r} is unknown: there are {known}")
        with extra("ros2", "messages of ROS 2 need rosbags"):
            from rosbags.interfaces import Nodetype
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.distribution = distribution
        self._nodes: Any = Nodetype
        self._parse: Any = get_types_from_msg
        self._store: Any = get_typestore(Stores(f"ros2_{distribution}"))
        self._correct_chars()
        for name, definition in {**VISION_TYPES, **PEOPLE_TYPES, **_EVENT_INFO}.items():
            if name not in self._store.fielddefs:
                self._store.register(self._parse(definition, name))
        self._add_service("action_msgs/srv/CancelGoal", _CANCEL)
        self._add_action(NAVIGATE, navigate_definition(distribution))
        self.hash = cache(self._hash)
        self._encoder = MessageEncoder(self._store)

    def _correct_chars(self) -> None:
        """Make char a uint8, as in rosidl: else the hashes of services would differ."""

        def corrected(part: Any) -> Any:
            if isinstance(part, tuple):
                return tuple(map(corrected, part))
            return "uint8" if part == "char" else part

        for name, (constants, fields) in list(self._store.fielddefs.items()):
            if "'char'" in str(fields):
                changed = [(field, corrected(kind)) for field, kind in fields]
                self._store.fielddefs[name] = constants, changed

    def _add(self, name: str, fields: Any) -> None:
        self._store.register({name: ([], fields)})

    def _add_part(self, name: str, definition: str) -> None:
        """Add a part of a service or action: the parser knows names of messages only."""
        package, _, last = name.split("/")
        alias = f"{package}/msg/{last}"
        fields = self._parse(definition, alias)[alias][1]
        self._add(name, fields or [(_PADDING, self._base("uint8"))])

    def _base(self, kind: str) -> Any:
        return self._nodes.BASE, (kind, 0)

    def _named(self, name: str) -> Any:
        return self._nodes.NAME, name

    def _add_service(self, name: str, definition: str) -> None:
        for kind, part in zip(("Request", "Response"), _parts(definition), strict=True):
            self._add_part(f"{name}_{kind}", part)
        self._add_service_type(name)

    def _add_service_type(self, name: str) -> None:
        """Add the event of a service and the service, whose request and response exist."""

        def at_most_one(kind: str) -> Any:
            return self._nodes.SEQUENCE, (self._named(f"{name}_{kind}"), 1)

        event = [
            ("info", self._named("service_msgs/msg/ServiceEventInfo")),
            ("request", at_most_one("Request")),
            ("response", at_most_one("Response")),
        ]
        self._add(f"{name}_Event", event)
        kinds = ("Request", "Response", "Event")
        messages = [(f"{kind.lower()}_message", self._named(f"{name}_{kind}")) for kind in kinds]
        self._add(name, messages)

    def _add_action(self, name: str, definition: str) -> None:
        for kind, part in zip(("Goal", "Result", "Feedback"), _parts(definition), strict=True):
            self._add_part(f"{name}_{kind}", part)
        goal_id = "goal_id", self._named(UUID)
        stamp = "stamp", self._named("builtin_interfaces/msg/Time")
        accepted = "accepted", self._base("bool")
        status = "status", self._base("int8")
        goal = "goal", self._named(f"{name}_Goal")
        result = "result", self._named(f"{name}_Result")
        feedback = "feedback", self._named(f"{name}_Feedback")
        self._add(f"{name}_SendGoal_Request", [goal_id, goal])
        self._add(f"{name}_SendGoal_Response", [accepted, stamp])
        self._add(f"{name}_GetResult_Request", [goal_id])
        self._add(f"{name}_GetResult_Response", [status, result])
        self._add_service_type(f"{name}_SendGoal")
        self._add_service_type(f"{name}_GetResult")
        self._add(f"{name}_FeedbackMessage", [goal_id, feedback])

    def _hash(self, name: str) -> str:
        """Return the hash of a type, `RIHS01_...`, by which ROS 2 tells types of one name apart."""
        if self.distribution == "humble":
            return "TypeHashNotSupported"  # hashes came with Iron
        return str(self._store.hash_rihs01(name))

    def encode(self, name: str, fields: Mapping[str, Any]) -> bytes:
        """Return a message as CDR, with its header; fields that are left out are 0 or empty.

        Raises:
            KeyError: The type has no such field.
        """
        return self._encoder.encode(name, fields)

    def decode(self, name: str, data: bytes) -> dict[str, Any]:
        """Return the fields of a message, arrays as NumPy's.

        Raises:
            ValueError: The bytes are no such message.
        """
        try:
            message = self._store.deserialize_cdr(data, name)
        except Exception as error:  # the library's generated code may raise anything
            raise ValueError(f"no {name}: {error}") from error
        fields: dict[str, Any] = _as_mapping(message)
        return fields


def _parts(definition: str) -> list[str]:
    """Return the parts of a definition, which lines `---` separate."""
    return f"\n{definition}".split("\n---")


def _as_mapping(value: Any) -> Any:
    if hasattr(value, "__dataclass_fields__"):
        names = (n for n in value.__dataclass_fields__ if not n.startswith("__"))
        return {name: _as_mapping(getattr(value, name)) for name in names}
    return [_as_mapping(part) for part in value] if isinstance(value, list) else value


def wire_name(name: str) -> str:
    """Return the name of a type on the wire, such as `std_msgs::msg::dds_::String_`.

    Example:
        >>> wire_name("std_msgs/msg/String")
        'std_msgs::msg::dds_::String_'
    """
    package, kind, last = name.split("/")
    return f"{package}::{kind}::dds_::{last}_"
