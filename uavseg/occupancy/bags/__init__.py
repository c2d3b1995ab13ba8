"""Recorded bags of ROS 1 and ROS 2: scans and poses, merged into a map."""
