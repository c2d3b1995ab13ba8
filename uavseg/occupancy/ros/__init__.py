"""ROS maps: YAML, PGM."""
