"""The lifecycle node: messages and transforms in, answers of `maps` and `planning` out."""

from typing import Any

import rclpy
import tf2_ros
from geometry_msgs.msg import Point, PoseStamped
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid, Path
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from uavseg.errors import PathError, UavsegError
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg_ros import maps, planning
from uavseg_ros.parameters import NodeParams, descriptions
from uavseg_ros.planning import PlanarPose, TransformMissingError


def _qos(depth: int, transient_local: bool = False) -> QoSProfile:
    durability = DurabilityPolicy.TRANSIENT_LOCAL if transient_local else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


class MapNode(LifecycleNode):
    """States, free space and objects of a map, and paths from the robot to goals.

    A map or an update that comes while the node is inactive is kept. Updates are answered together, at most
    once an `update_period`. Whatever fails is logged once, and again when its reason changes.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("uavseg_ros", **kwargs)
        for name, (default, description) in descriptions().items():
            # Types are checked by NodeParams, so that `clearance: 0` is a number too.
            about = ParameterDescriptor(name=name, description=description, dynamic_typing=True)
            self.declare_parameter(name, default, about)
        self._params = NodeParams()
        self._entities: list[Any] = []
        self._forget()

    def _forget(self) -> None:
        self._active = False
        self._map: Any = None  # the message, with all updates
        self._is_stale = False  # whether the map has changed since its states were published
        self._forget_goal()
        self._logged: dict[str, str] = {}

    def _forget_goal(self) -> None:
        self._goal: Any = None
        self._goal_in_frame: tuple[str, PlanarPose] | None = None  # frame of the map, and pose in it
        self._is_waiting = False  # whether the goal lacks a map or a transform
        self._has_path: bool | None = None  # whether the last path published had poses; None: not yet

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read parameters, and make subscriptions and publishers; fail where a parameter is wrong."""
        try:
            self._params = NodeParams(**{name: self.get_parameter(name).value for name in descriptions()})
        except UavsegError as error:
            self.get_logger().error(f"not configured: {error}")
            return TransitionCallbackReturn.FAILURE
        kept = _qos(1, transient_local=True)
        self._states = self.create_lifecycle_publisher(OccupancyGrid, "states", kept)
        self._free_space = self.create_lifecycle_publisher(OccupancyGrid, "free_space", kept)
        self._objects = self.create_lifecycle_publisher(MarkerArray, "objects", kept)
        self._path = self.create_lifecycle_publisher(Path, "path", _qos(1))
        self._entities = [
            self.create_subscription(
                OccupancyGrid, "map", self._on_map, _qos(1, self._params.map_transient_local)
            ),
            self.create_subscription(OccupancyGridUpdate, "map_updates", self._on_update, _qos(100)),
            self.create_subscription(PoseStamped, "goal_pose", self._on_goal, _qos(1)),
        ]
        self._timer = self.create_timer(self._params.update_period, self._on_timer)
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer, self)
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let the timer answer the map that came before, if one did."""
        self._active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish an empty path where one was published, and forget the goal; the map is kept."""
        if self._has_path:
            self._publish_path(None, None)
        self._active = False
        self._forget_goal()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Remove all that `on_configure` made, and forget the map."""
        self._release()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do as `on_cleanup`."""
        self._release()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do as `on_cleanup`, so that the node can be configured again."""
        self._release()
        return super().on_error(state)

    def _release(self) -> None:
        self._forget()
        if not self._entities:
            return
        for subscription in self._entities:
            self.destroy_subscription(subscription)
        self._entities = []
        self._listener.unregister()
        self.destroy_timer(self._timer)
        for publisher in (self._states, self._free_space, self._objects, self._path):
            self.destroy_lifecycle_publisher(publisher)

    def _on_map(self, message: Any) -> None:
        try:
            maps.read_map(message)
        except UavsegError as error:
            self._log("map", f"map refused: {error}")
            return
        self._log("map", "")
        self._map, self._is_stale = message, True
        if self._active:
            self._answer_map()

    def _on_update(self, update: Any) -> None:
        if self._map is None:
            self._log("update", "an update came before the map, and is left out")
            return
        try:
            maps.apply_update(self._map, update)
        except UavsegError as error:
            self._log("update", f"update refused: {error}")
            return
        self._log("update", "")
        self._is_stale = True

    def _on_goal(self, goal: Any) -> None:
        if not self._active:
            self.get_logger().warning("a goal is left out, because the node is not active")
            return
        self._forget_goal()
        self._log("path", "")
        self._goal = goal
        self._answer_goal()

    def _on_timer(self) -> None:
        if self._active and self._is_stale:
            self._answer_map()
        elif self._is_waiting:  # only while active
            self._answer_goal()

    def _answer_map(self) -> None:
        self._is_stale = False
        try:
            found = maps.classify_map(maps.read_map(self._map), self._params)
        except UavsegError as error:
            self._log("states", f"no states: {error}")
        else:
            self._log("states", "; ".join(found.warnings))
            self._states.publish(maps.states_message(found, self._map, OccupancyGrid))
            free_space = maps.free_space_message(found, self._params, self._map, OccupancyGrid)
            self._free_space.publish(free_space)
            self._objects.publish(maps.objects_message(found, self._map, MarkerArray, Marker, Point))
        if self._goal is not None and (self._params.replan or self._is_waiting):
            self._answer_goal()

    def _answer_goal(self) -> None:
        self._is_waiting = self._map is None
        if self._is_waiting:
            self._log("path", "no path yet: no map has come")
            return
        try:
            start = planning.frame_in_plane(self._transform(self._params.base_frame))
            goal = self._goal_in_map()
            path = planning.plan_path(maps.read_map(self._map), start, goal, self._params)
        except TransformMissingError as error:
            self._is_waiting = True
            self._log("path", f"no path yet: {error}")
            self._publish_path(None, None)
        except UavsegError as error:
            self._log("path", f"no path: {error}")
            self._publish_path(None, None)
        else:
            self._log("path", "; ".join(path.warnings))
            self._publish_path(path, goal)

    def _goal_in_map(self) -> PlanarPose:
        """Move the goal into the frame of the map, once: one ahead of the robot stays where it was."""
        frame, own = self._goal.header.frame_id, self._map.header.frame_id
        if self._goal_in_frame is None or self._goal_in_frame[0] != own:
            transform = None if frame == own else self._transform(frame)
            self._goal_in_frame = own, planning.pose_in_plane(self._goal.pose, transform)
        return self._goal_in_frame[1]

    def _transform(self, frame: str) -> Any:
        """Return the latest transform from a frame to that of the map."""
        own = self._map.header.frame_id
        if not (frame and own):
            raise PathError(f"{'the map' if frame else 'the goal'} has no frame_id in its header")
        try:
            found = self._buffer.lookup_transform(own, frame, Time())
        except tf2_ros.TransformException as error:
            raise TransformMissingError(f"no transform from {frame} to {own} ({error})") from error
        planning.check_age(found, self.get_clock().now().nanoseconds, self._params.transform_tolerance)
        return found

    def _publish_path(self, path: PlannedPath | None, goal: PlanarPose | None) -> None:
        """Publish a path; an empty one only if it is news."""
        if path is None and self._has_path is False:
            return
        self._has_path = path is not None
        header = Header()
        header.stamp = self.get_clock().now().to_msg()
        header.frame_id = self._map.header.frame_id
        spacing = self._params.path_spacing
        self._path.publish(planning.path_message(path, goal, header, spacing, Path, PoseStamped))

    def _log(self, about: str, text: str) -> None:
        """Warn of something, unless it was the last thing said about it; an empty text ends it."""
        if text and self._logged.get(about) != text:
            self.get_logger().warning(text)
        self._logged[about] = text


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = MapNode()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
