"""Regions with concave places and holes."""

import shapely

U = shapely.box(0, 0, 200, 200) - shapely.box(60, 60, 140, 200)


RING = shapely.Point(0, 0).buffer(100) - shapely.Point(10, 5).buffer(45)


HOLES = shapely.box(0, 0, 300, 200) - shapely.box(60, 60, 110, 140) - shapely.Point(200, 100).buffer(30)
