"""A lifecycle node of ROS 2 over occupancy maps: states, free space, objects and paths."""
