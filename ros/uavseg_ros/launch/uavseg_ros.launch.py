"""Start the node; by default, configure it and then activate it."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.conditions import IfCondition
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from launch_ros.substitutions import FindPackageShare
from lifecycle_msgs.msg import Transition


def generate_launch_description() -> LaunchDescription:
    """Return the arguments, the node and its transitions."""
    params_file = PathJoinSubstitution([FindPackageShare("uavseg_ros"), "config", "uavseg_ros.yaml"])
    automatic = IfCondition(LaunchConfiguration("autostart"))
    node = LifecycleNode(
        package="uavseg_ros",
        executable="map_node",
        name="uavseg_ros",
        namespace=LaunchConfiguration("namespace"),
        output="screen",
        parameters=[
            LaunchConfiguration("params_file"),
            {"use_sim_time": LaunchConfiguration("use_sim_time")},
        ],
        remappings=[
            ("map", LaunchConfiguration("map")),
            ("map_updates", [LaunchConfiguration("map"), "_updates"]),
        ],
    )
    # Only where it was configured: a node that someone deactivates stays inactive.
    activate = OnStateTransition(
        target_lifecycle_node=node,
        start_state="configuring",
        goal_state="inactive",
        entities=[_change(node, Transition.TRANSITION_ACTIVATE)],
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=params_file, description="YAML of parameters"),
            DeclareLaunchArgument("namespace", default_value="", description="Namespace of node and topics"),
            DeclareLaunchArgument("map", default_value="map", description="Topic of the map"),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", description="Use the time of /clock"
            ),
            DeclareLaunchArgument("autostart", default_value="true", description="Configure and activate it"),
            RegisterEventHandler(activate, condition=automatic),
            node,
            _change(node, Transition.TRANSITION_CONFIGURE, automatic),
        ]
    )


def _change(node: LifecycleNode, transition: int, condition: IfCondition | None = None) -> EmitEvent:
    event = ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition)
    return EmitEvent(event=event, condition=condition)
