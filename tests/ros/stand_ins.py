"""Stand-ins for rclpy, tf2 and the generated message packages, as far as the node uses them.

They keep what the node makes and publishes, and check what rclpy checks: the types of fields; lifecycle
publishers are silent unless they are active.
"""

import copy
import sys
from collections.abc import Callable
from enum import Enum
from functools import partial
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from tests.ros.messages import check_types, new

MESSAGES = {
    "geometry_msgs": ["Point", "PoseStamped"],
    "map_msgs": ["OccupancyGridUpdate"],
    "nav_msgs": ["OccupancyGrid", "Path"],
    "std_msgs": ["Header"],
    "visualization_msgs": ["Marker", "MarkerArray"],
}


class TransitionCallbackReturn(Enum):
    SUCCESS, FAILURE, ERROR = range(3)


class Publisher:
    def __init__(self, kind: str, topic: str, qos: Any) -> None:
        self.kind, self.topic, self.qos = kind, topic, qos
        self.messages: list[Any] = []
        self.active = False

    def publish(self, message: Any) -> None:
        check_types(message)
        if self.active:
            self.messages.append(copy.deepcopy(message))  # as rclpy, which serialises it here


class LifecycleNode:
    """`rclpy.lifecycle.LifecycleNode`; `overrides` are what a YAML file gives."""

    def __init__(self, name: str, overrides: dict[str, Any] | None = None) -> None:
        self.name, self.overrides, self.parameters = name, overrides or {}, {}
        self.publishers: dict[str, Publisher] = {}
        self.subscriptions: dict[str, Any] = {}
        self.timers: list[Any] = []
        self.log: list[tuple[str, str]] = []
        self.now_ns = 100_000_000_000

    def declare_parameter(self, name: str, value: Any, descriptor: Any) -> None:
        assert descriptor.description and descriptor.dynamic_typing
        self.parameters[name] = self.overrides.get(name, value)

    def get_parameter(self, name: str) -> Any:
        return SimpleNamespace(value=self.parameters[name])

    def create_lifecycle_publisher(self, kind: Any, topic: str, qos: Any) -> Publisher:
        self.publishers[topic] = Publisher(kind.args[0], topic, qos)
        return self.publishers[topic]

    def destroy_lifecycle_publisher(self, publisher: Publisher) -> None:
        del self.publishers[publisher.topic]

    def create_subscription(self, kind: Any, topic: str, call: Callable[[Any], None], qos: Any) -> Any:
        self.subscriptions[topic] = SimpleNamespace(kind=kind.args[0], topic=topic, call=call, qos=qos)
        return self.subscriptions[topic]

    def destroy_subscription(self, subscription: Any) -> None:
        del self.subscriptions[subscription.topic]

    def create_timer(self, period: float, call: Callable[[], None]) -> Any:
        self.timers.append(SimpleNamespace(period=period, call=call))
        return self.timers[-1]

    def destroy_timer(self, timer: Any) -> None:
        self.timers.remove(timer)

    def get_logger(self) -> Any:
        levels = ("info", "warning", "error")
        return SimpleNamespace(
            **{level: lambda text, level=level: self.log.append((level, text)) for level in levels}
        )

    def get_clock(self) -> Any:
        seconds, rest = divmod(self.now_ns, 1_000_000_000)

        def stamp() -> Any:
            made = new("builtin_interfaces/Time")
            made.sec, made.nanosec = seconds, rest
            return made

        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=self.now_ns, to_msg=stamp))

    def destroy_node(self) -> None:
        self.log.append(("info", "destroyed"))

    def _set_active(self, active: bool) -> TransitionCallbackReturn:
        for publisher in self.publishers.values():
            publisher.active = active
        return TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        return TransitionCallbackReturn.SUCCESS

    on_cleanup = on_shutdown = on_error = on_configure

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        return self._set_active(True)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        return self._set_active(False)


class TransformException(Exception):  # noqa: N818, its name in tf2
    pass


class Buffer:
    """`tf2_ros.Buffer`, whose transforms a test puts into `known` by the name of the child frame."""

    def __init__(self) -> None:
        self.known: dict[str, Any] = {}

    def lookup_transform(self, target: str, source: str, time: Any) -> Any:
        if source not in self.known:
            raise TransformException(
                f'"{source}" passed to lookupTransform argument source_frame does not exist'
            )
        assert self.known[source].header.frame_id == target
        return self.known[source]


class TransformListener:
    def __init__(self, buffer: Buffer, node: LifecycleNode) -> None:
        self.node = node
        node.subscriptions["/tf"] = self

    def unregister(self) -> None:
        del self.node.subscriptions["/tf"]


class ExternalShutdownException(Exception):  # noqa: N818, its name in rclpy
    pass


def install(monkeypatch: pytest.MonkeyPatch) -> dict[str, ModuleType]:
    """Put the stand-ins in the place of the modules, for one test; `uavseg_ros.node` is imported anew."""
    policies = {"VOLATILE": "volatile", "TRANSIENT_LOCAL": "transient local"}
    state = SimpleNamespace
    made = {
        "rclpy": _module("rclpy", init=lambda args: None, spin=lambda node: None, try_shutdown=lambda: None),
        "rclpy.executors": _module("rclpy.executors", ExternalShutdownException=ExternalShutdownException),
        "rclpy.lifecycle": _module(
            "rclpy.lifecycle",
            LifecycleNode=LifecycleNode,
            LifecycleState=state,
            TransitionCallbackReturn=TransitionCallbackReturn,
        ),
        "rclpy.qos": _module(
            "rclpy.qos",
            DurabilityPolicy=SimpleNamespace(**policies),
            ReliabilityPolicy=SimpleNamespace(RELIABLE="reliable"),
            QoSProfile=SimpleNamespace,
        ),
        "rclpy.time": _module("rclpy.time", Time=SimpleNamespace),
        "rcl_interfaces": _module("rcl_interfaces"),
        "rcl_interfaces.msg": _module("rcl_interfaces.msg", ParameterDescriptor=SimpleNamespace),
        "tf2_ros": _module(
            "tf2_ros",
            Buffer=Buffer,
            TransformException=TransformException,
            TransformListener=TransformListener,
        ),
    }
    for package, names in MESSAGES.items():
        classes = {name: partial(new, f"{package}/{name}") for name in names}
        made |= {package: _module(package), f"{package}.msg": _module(f"{package}.msg", **classes)}
    for name, module in made.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "uavseg_ros.node", raising=False)
    return made


def _module(name: str, **names: Any) -> ModuleType:
    module = ModuleType(name)
    vars(module).update(names)
    return module
