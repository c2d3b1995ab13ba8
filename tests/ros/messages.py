"""Messages of ROS 2 for tests, of rosbags' types: empty ones, and a room with a wall."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

UPDATE = "map_msgs/msg/OccupancyGridUpdate"
STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(
    get_types_from_msg(
        "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n", UPDATE
    )
)
_ZEROS: dict[str, Any] = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}
_KINDS = {"string": str, "bool": bool, "float32": float, "float64": float}


def new(name: str) -> Any:
    """Make an empty message of a type such as "nav_msgs/Path", all zeros but for the w of quaternions."""
    name = name if "/msg/" in name else name.replace("/", "/msg/")
    fields = {field: _empty(kind) for field, kind in STORE.fielddefs[name][1]}
    if name.endswith("/Quaternion"):
        fields["w"] = 1.0
    return STORE.types[name](**fields)


def _empty(kind: tuple[Any, Any]) -> Any:
    node, about = kind
    if node.name == "NAME":
        return new(about)
    if node.name == "BASE":
        return _ZEROS.get(about[0], 0)
    inner = about[0]
    return np.zeros(0, inner[1][0]) if inner[0].name == "BASE" and inner[1][0] != "string" else []


def serialised(message: Any) -> Any:
    """Check that each field has the type that rclpy asks for, then write and read the message as CDR."""
    check_types(message)
    return STORE.deserialize_cdr(STORE.serialize_cdr(message, message.__msgtype__), message.__msgtype__)


def check_types(message: Any) -> None:
    for field, (node, about) in STORE.fielddefs[message.__msgtype__][1]:
        value = getattr(message, field)
        if node.name == "NAME":
            check_types(value)
        elif node.name == "BASE":
            assert isinstance(value, _KINDS.get(about[0], int)), (message.__msgtype__, field, value)
        elif about[0][0].name == "NAME":
            assert isinstance(value, list)
            for one in value:
                check_types(one)


def grid(
    cells: NDArray[np.int8], resolution: float = 0.05, origin: tuple[float, float, float] = (0, 0, 0)
) -> Any:
    """A map, its lowest row first; `origin` is x, y and yaw of its lower left corner."""
    message = new("nav_msgs/OccupancyGrid")
    message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec = "map", 7, 9
    message.info.height, message.info.width = cells.shape
    message.info.resolution = float(np.float32(resolution))
    message.info.origin = pose(*origin)
    message.data = np.ravel(cells).astype(np.int8)
    return message


def pose(x: float, y: float, yaw: float = 0.0) -> Any:
    made = new("geometry_msgs/Pose")
    made.position.x, made.position.y = float(x), float(y)
    made.orientation.z, made.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return made


def goal(x: float, y: float, yaw: float = 0.0, frame: str = "map") -> Any:
    made = new("geometry_msgs/PoseStamped")
    made.header.frame_id, made.pose = frame, pose(x, y, yaw)
    return made


def transform(x: float, y: float, yaw: float = 0.0, child: str = "base_link", stamp: float = 0.0) -> Any:
    """The transform from a frame to that of the map, as tf2 looks it up."""
    made = new("geometry_msgs/TransformStamped")
    made.header.frame_id, made.child_frame_id = "map", child
    made.header.stamp.sec, made.header.stamp.nanosec = int(stamp), round(stamp % 1 * 1e9)
    made.transform.translation.x, made.transform.translation.y = float(x), float(y)
    made.transform.rotation.z, made.transform.rotation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return made


def update(row: int, col: int, cells: NDArray[np.int8], frame: str = "map") -> Any:
    made = new(UPDATE)
    made.header.frame_id, made.header.stamp.sec = frame, 8
    made.y, made.x, made.height, made.width = row, col, *cells.shape
    made.data = np.ravel(cells).astype(np.int8)
    return made


def room() -> NDArray[np.int8]:
    """Cells of a room of 6.4 x 3.2 m; a wall of 0.4 m divides it but for a door at the top, 1.2 m wide."""
    cells = np.zeros((64, 128), np.int8)
    cells[:40, 70:78] = 100
    cells[:, :4] = -1
    return cells
