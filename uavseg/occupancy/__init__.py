"""Occupancy maps: mapping, paths, ROS files, simulation."""
