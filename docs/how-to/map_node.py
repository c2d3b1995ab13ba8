"""A ROS 2 node: an occupancy map in; its states, and a path through what is free, out."""

from copy import deepcopy

from uavseg import OccupancyGrid, UavsegError, classify, path


def answer(message, pose, start=(0.5, 0.5), goal=(3.0, 2.0)):
    """The states of a map as a message like `message`, and a path over it in messages like `pose`."""
    grid = OccupancyGrid.from_message(message)
    p = (classify(grid).states - 1) / 2  # 1 free, 2 unknown, 3 occupied
    states = OccupancyGrid.from_probabilities(p, grid.geobox)
    found = path(grid, range=(0, 0.45), start=start, goal=goal, clearance=0.2, smooth=True)
    poses = [deepcopy(pose) for _ in found.xy]
    for one, (x, y) in zip(poses, found.xy, strict=True):
        one.header, one.pose.position.x, one.pose.position.y = message.header, float(x), float(y)
    return states.to_message(deepcopy(message)), poses


if __name__ == "__main__":
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from nav_msgs import msg
    from rclpy.qos import DurabilityPolicy, QoSProfile

    def received(message):
        try:
            states, poses = answer(message, PoseStamped())
            maps.publish(states)
            paths.publish(msg.Path(header=message.header, poses=poses))
        except UavsegError as error:
            node.get_logger().error(str(error))

    rclpy.init()
    node, kept = rclpy.create_node("states"), QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    maps = node.create_publisher(msg.OccupancyGrid, "states", kept)
    paths = node.create_publisher(msg.Path, "path", kept)
    node.create_subscription(msg.OccupancyGrid, "map", received, kept)
    rclpy.spin(node)
