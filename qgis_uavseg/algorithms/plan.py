"""Plan a mission over regions, and show its legs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Dict, List, Sequence

from qgis.core import (
    QgsProcessing,
    QgsProcessingException,
    QgsProcessingOutputNumber,
    QgsProcessingParameterFeatureSink,
    QgsProcessingParameterFeatureSource,
    QgsProcessingParameterFileDestination,
    QgsProcessingUtils,
)

from ..legs import LEG_FIELDS, WGS84, leg_features
from ..options import Option, Values, choice, file, latlon, metres, number, place, plain, polygons, raster, shown, switch, text, unless, words_of
from ..process import run
from ..program import ready_program
from ..styles import LEG_STYLE, style_on_load
from ..targets import refuse_unsaved
from .base import ProgramAlgorithm

GROUP = ("missions", "Missions")
AUTOPILOTS = ("ardupilot", "px4", "generic")
MISSION_EXTENSIONS = ("plan", "waypoints", "kmz", "csv", "kml", "geojson")
MISSION_FILTER = "Missions (*.plan *.waypoints *.kmz *.csv *.kml *.geojson)"
TARGET_FILTER = (
    "QGroundControl (*.plan);;Mission Planner (*.waypoints);;DJI Pilot 2 (*.kmz);;Litchi (*.csv);;"
    "KML (*.kml);;GeoJSON (*.geojson)"
)


def _home(values: Values) -> List[str]:
    if not values.given("HOME"):
        if values.given("HOME_ALTITUDE"):
            raise QgsProcessingException("Height of home: give Home as well, or leave both empty")
        return ["--home=auto"]
    height = f",{plain(values.number('HOME_ALTITUDE'))}" if values.given("HOME_ALTITUDE") else ""
    return [f"--home={latlon(values, 'HOME')}{height}"]


class PlanMission(ProgramAlgorithm):
    """`uavseg plan`."""

    NAME = "plan"
    TITLE = "Plan mission"
    GROUP = GROUP
    SUMMARY = (
        "Plans a flight over regions: take-off at home, every region in a short order, return. The file is for "
        "QGroundControl (.plan), Mission Planner (.waypoints), DJI Pilot 2 (.kmz) or Litchi (.csv). Look at the legs before you "
        "fly: the plan knows nothing of trees, wires or roads."
    )
    TAGS = ("mission", "survey", "waypoints", "flight", "mavlink", "photogrammetry")

    def options(self) -> Sequence[Option]:
        return (
            Option(
                lambda: QgsProcessingParameterFeatureSource(
                    "REGIONS", "Regions", [QgsProcessing.TypeVectorPolygon]
                ),
                lambda _: [],
                "Polygons to fly over; those that are selected, if you tick that.",
                advanced=False,
            ),
            unless(shown(metres("ALTITUDE", "Height of the flight", "--altitude", "Above home, or with an elevation model above the ground. Or give a ground sampling distance.", 60)), ("GSD",)),
            place("HOME", "Home", "Where the vehicle takes off. Empty: a place outside of the regions, which you must look at.", True, _home),
            Option(metres("HOME_ALTITUDE", "", "", "", None, -500).make, lambda _: [], "Of home above the sea. Empty: written as 0, which formats that need it cannot use."),
            choice("PATTERN", "Pattern", "--pattern", "A point in each region, its outline, parallel lines, lines along its middle, or a circle. Empty: a point, or lines with a spacing or a camera.", ("visit", "perimeter", "survey", "corridor", "orbit")),
            shown(metres("SPACING", "Between lines", "--spacing", "Of a survey or corridor; a camera gives it by itself.")),
            text("CAMERA", "Camera", "--camera", "A name as `uavseg cameras` lists them, such as DJI Mavic 3 Enterprise, or a .json file.", advanced=False),
            number("GSD", "Ground sampling distance in cm", "--gsd", "With a camera, in place of the height, which is then left empty.", 0),
            text("OVERLAP", "Overlap", "--overlap", "Of photographs along lines and between them, in per cent. Empty: 75,70."),
            polygons("AVOID", "Keep-out zones", "--avoid", "Polygons that no leg enters."),
            metres("AVOID_MARGIN", "Least distance to keep-out zones", "--avoid-margin", "Empty: 10 m."),
            choice("AUTOPILOT", "Autopilot", "--autopilot", "What the mission is for. Empty: ardupilot.", AUTOPILOTS),
            number("SPEED", "Speed in m/s", "--speed", "Empty: 5.", 0),
            text("ANGLE", "Direction of lines", "--angle", "Azimuth in degrees, or auto."),
            raster("RASTER", "Raster of the regions", "--raster", "Regions at its edge are refused, because they may go on beyond it."),
            switch("ALLOW_EDGE", "Fly over regions at the edge of the raster", "--allow-edge", "In place of refusing."),
            raster("DEM", "Elevation model", "--dem", "Fly the height above this ground."),
            choice("TERRAIN", "Heights with an elevation model", "--terrain", "Empty: absolute.", ("frame", "absolute", "relative")),
            number("ENDURANCE", "Minutes in the air", "--endurance", "On a full battery: the mission is divided into flights that fit.", 0),
            number("RESERVE", "Reserve in per cent", "--reserve", "Of the endurance at the end of each flight. Empty: 20.", 0),
            metres("MAX_ALTITUDE", "Highest above home", "--max-altitude", "Refuse to fly higher. Empty: 120 m."),
            metres("MAX_DISTANCE", "Farthest from home", "--max-distance", "Refuse to fly farther."),
            text("FENCE", "Fence in metres", "--fence", "Around each flight, or none. Empty: 50."),
            text("WHERE", "Only regions where", "--where", "Such as: mean > 0.7 and area_m2 > 500"),
            number("LARGEST", "Only the largest", "--largest", "So many.", 1, integer=True),
            file("VEHICLE", "Vehicle", "--vehicle", "What flies, for estimates of time and energy.", "Vehicle (*.json)"),
            choice("TRIGGER", "Photographs", "--trigger", "By distance, by time, in hover, or not by the mission.", ("distance", "interval", "hover", "none")),
            switch("CROSSHATCH", "Survey twice, at a right angle", "--crosshatch", "For models of buildings."),
            switch("EDITABLE", "Survey items that QGroundControl can edit", "--editable", "In a .plan, where a part is convex; the same flight."),
        )

    def initAlgorithm(self, configuration: Any = None) -> None:
        super().initAlgorithm(configuration)
        self.parameterDefinition("HOME_ALTITUDE").setDescription("Height of home above the sea")

    def add_outputs(self) -> None:
        self.addParameter(QgsProcessingParameterFileDestination("OUTPUT", "Mission", TARGET_FILTER))
        self.addParameter(
            QgsProcessingParameterFeatureSink("LEGS", "Legs", QgsProcessing.TypeVectorLine, None, True)
        )
        for name, label in _NUMBERS.items():
            self.addOutput(QgsProcessingOutputNumber(name, label))

    def answer(self, values: Values) -> Dict[str, Any]:
        target = self.file_target(values, "OUTPUT", MISSION_EXTENSIONS)
        words = ["plan", *words_of(self.options(), values), *self._regions(values)]
        finished = self.succeed(values, [*words[:-2], f"--output={target}", "--overwrite", "--json", *words[-2:]], show_output=False)
        found = json.loads(finished.output)
        for warning in found["warnings"]:
            values.feedback.pushWarning(warning)
        folder = Path(target).parent
        results: Dict[str, Any] = {"OUTPUT": str(folder / found["flights"][0]["file"]), **_totals(found)}
        for flight in found["flights"]:
            values.feedback.pushInfo(_line(flight))
        if len(found["flights"]) > 1:
            values.feedback.pushWarning(
                f"the mission is divided into {len(found['flights'])} flights, each in a file of its own in {folder}"
            )
        legs = self._legs(values, words)
        return {**results, "LEGS": legs} if legs else results

    def _regions(self, values: Values) -> List[str]:
        """The file of the regions and its layer, last on the command line."""
        layer = self.parameterAsVectorLayer(values.parameters, "REGIONS", values.context)
        if layer is not None:
            refuse_unsaved(layer, values.label("REGIONS"))
        path, name = self.parameterAsCompatibleSourceLayerPathAndLayerName(
            values.parameters, "REGIONS", values.context, ["gpkg", "geojson", "fgb", "shp"], "gpkg", values.feedback
        )
        return [*([f"--layer={name}"] if name else []), "--", path]

    def _legs(self, values: Values, words: List[str]) -> str:
        """The legs as a layer, from the same plan as GeoJSON; empty if they were not asked for."""
        if not values.given("LEGS"):
            return ""
        target = Path(QgsProcessingUtils.generateTempFilename("mission.geojson"))
        shown = [*words[:-2], f"--output={target}", "--overwrite", "--json", *words[-2:]]
        finished = run(str(ready_program()), shown, values.feedback, show_output=False)
        if finished.code:
            raise QgsProcessingException(f"the mission is written, its legs cannot be shown: {finished.error()}")
        files = [target.parent / flight["file"] for flight in json.loads(finished.output)["flights"]]
        sink, name = self.parameterAsSink(
            values.parameters, "LEGS", values.context, LEG_FIELDS, *WGS84
        )
        if sink is None:
            raise QgsProcessingException(self.invalidSinkError(values.parameters, "LEGS"))
        for feature in leg_features(files):
            sink.addFeature(feature)
        style_on_load(name, LEG_STYLE, values.context)
        return name


def _totals(found: Dict[str, Any]) -> Dict[str, Any]:
    flights = found["flights"]
    sums = {name: sum(flight[name.lower()] for flight in flights) for name in ("DISTANCE_M", "DURATION_S", "PHOTOGRAPHS")}
    return {"FLIGHTS": len(flights), **sums}


def _line(flight: Dict[str, Any]) -> str:
    minutes, seconds = divmod(round(flight["duration_s"]), 60)
    return (
        f"{flight['file']}: {flight['items']} items, {flight['distance_m'] / 1000:.2f} km, "
        f"about {minutes} min {seconds} s, {flight['photographs']} photographs"
    )


_NUMBERS = {
    "FLIGHTS": "Flights",
    "DISTANCE_M": "Length in metres",
    "DURATION_S": "Time in seconds",
    "PHOTOGRAPHS": "Photographs",
}
