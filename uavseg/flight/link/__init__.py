"""MAVLink link to a vehicle: missions, fences and rally points over the mission protocol."""
