"""Mission planning: polygons to waypoints, as .plan and .waypoints files."""
