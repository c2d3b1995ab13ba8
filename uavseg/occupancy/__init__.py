"""What a robot believes: occupancy maps, the sensor that makes them, paths over them."""
