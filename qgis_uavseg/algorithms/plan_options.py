"""Parameters of Plan mission."""

from __future__ import annotations

from qgis.core import QgsProcessing, QgsProcessingException, QgsProcessingParameterFeatureSource

from ..options import (
    Option,
    Values,
    choice,
    file,
    metres,
    number,
    plain,
    polygons,
    raster,
    shown,
    switch,
    text,
    unless,
)
from ..places import latlon, place

AUTOPILOTS = ("ardupilot", "px4", "generic")


def _home(values: Values) -> list[str]:
    if not values.given("HOME"):
        if values.given("HOME_ALTITUDE"):
            raise QgsProcessingException("Height of home: give Home as well, or leave both empty")
        return ["--home=auto"]
    height = f",{plain(values.number('HOME_ALTITUDE'))}" if values.given("HOME_ALTITUDE") else ""
    return [f"--home={latlon(values, 'HOME')}{height}"]


PLAN_OPTIONS = (
    Option(
        lambda: QgsProcessingParameterFeatureSource("REGIONS", "Regions", [QgsProcessing.TypeVectorPolygon]),
        lambda _: [],
        "Polygons to fly over; those that are selected, if you tick that.",
        advanced=False,
    ),
    unless(
        shown(
            metres(
                "ALTITUDE",
                "Height of the flight",
                "--altitude",
                "Above home, or with an elevation model above the ground. Or give a ground "
                "sampling distance.",
                60,
            )
        ),
        ("GSD",),
    ),
    place(
        "HOME",
        "Home",
        "Where the vehicle takes off. Empty: a place outside of the regions, which you must look at.",
        True,
        _home,
    ),
    Option(
        metres("HOME_ALTITUDE", "", "", "", None, -500).make,
        lambda _: [],
        "Of home above the sea. Empty: written as 0, which formats that need it cannot use.",
    ),
    choice(
        "PATTERN",
        "Pattern",
        "--pattern",
        "A point in each region, its outline, parallel lines, lines along its middle, or a "
        "circle. Empty: a point, or lines with a spacing or a camera.",
        ("visit", "perimeter", "survey", "corridor", "orbit"),
    ),
    shown(
        metres(
            "SPACING",
            "Between lines",
            "--spacing",
            "Of a survey or corridor; a camera gives it by itself.",
        )
    ),
    text(
        "CAMERA",
        "Camera",
        "--camera",
        "A name as `uavseg cameras` lists them, such as DJI Mavic 3 Enterprise, or a .json file.",
        advanced=False,
    ),
    number(
        "GSD",
        "Ground sampling distance in cm",
        "--gsd",
        "With a camera, in place of the height, which is then left empty.",
        0,
    ),
    text(
        "OVERLAP",
        "Overlap",
        "--overlap",
        "Of photographs along lines and between them, in per cent. Empty: 75,70.",
    ),
    polygons("AVOID", "Keep-out zones", "--avoid", "Polygons that no leg enters."),
    metres("AVOID_MARGIN", "Least distance to keep-out zones", "--avoid-margin", "Empty: 10 m."),
    choice(
        "AUTOPILOT",
        "Autopilot",
        "--autopilot",
        "What the mission is for. Empty: ardupilot.",
        AUTOPILOTS,
    ),
    number("SPEED", "Speed in m/s", "--speed", "Empty: 5.", 0),
    text("ANGLE", "Direction of lines", "--angle", "Azimuth in degrees, or auto."),
    raster(
        "RASTER",
        "Raster of the regions",
        "--raster",
        "Regions at its edge are refused, because they may go on beyond it.",
    ),
    switch(
        "ALLOW_EDGE",
        "Fly over regions at the edge of the raster",
        "--allow-edge",
        "In place of refusing.",
    ),
    raster("DEM", "Elevation model", "--dem", "Fly the height above this ground."),
    choice(
        "TERRAIN",
        "Heights with an elevation model",
        "--terrain",
        "Empty: absolute.",
        ("frame", "absolute", "relative"),
    ),
    number(
        "ENDURANCE",
        "Minutes in the air",
        "--endurance",
        "On a full battery: the mission is divided into flights that fit.",
        0,
    ),
    number(
        "RESERVE",
        "Reserve in per cent",
        "--reserve",
        "Of the endurance at the end of each flight. Empty: 20.",
        0,
    ),
    metres("MAX_ALTITUDE", "Highest above home", "--max-altitude", "Refuse to fly higher. Empty: 120 m."),
    metres("MAX_DISTANCE", "Farthest from home", "--max-distance", "Refuse to fly farther."),
    text("FENCE", "Fence in metres", "--fence", "Around each flight, or none. Empty: 50."),
    text("WHERE", "Only regions where", "--where", "Such as: mean > 0.7 and area_m2 > 500"),
    number("LARGEST", "Only the largest", "--largest", "So many.", 1, integer=True),
    file(
        "VEHICLE",
        "Vehicle",
        "--vehicle",
        "What flies, for estimates of time and energy.",
        "Vehicle (*.json)",
    ),
    choice(
        "TRIGGER",
        "Photographs",
        "--trigger",
        "By distance, by time, in hover, or not by the mission.",
        ("distance", "interval", "hover", "none"),
    ),
    switch("CROSSHATCH", "Survey twice, at a right angle", "--crosshatch", "For models of buildings."),
    switch(
        "EDITABLE",
        "Survey items that QGroundControl can edit",
        "--editable",
        "In a .plan, where a part is convex; the same flight.",
    ),
)
