"""Where the vehicle may fly: keep-out zones, and the shortest ways around them."""
