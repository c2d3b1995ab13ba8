"""Plan a mission over regions, and show its legs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

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
from ..options import TABLE, Option, Values, definition, listed, plain, unless, words_of
from ..places import latlon, place
from ..process import run
from ..program import ready_program
from ..styles import style_on_load
from ..targets import refuse_unsaved
from .base import ProgramAlgorithm

GROUP = ("missions", "Missions")
MISSION_EXTENSIONS = ("plan", "waypoints", "kmz", "csv", "kml", "geojson")
MISSION_FILTER = "Missions (*.plan *.waypoints *.kmz *.csv *.kml *.geojson)"
TARGET_FILTER = (
    "QGroundControl (*.plan);;Mission Planner (*.waypoints);;DJI Pilot 2 (*.kmz);;Litchi (*.csv);;"
    "KML (*.kml);;GeoJSON (*.geojson)"
)

AUTOPILOTS = TABLE["plan"]["AUTOPILOT"]["choices"]
PATTERNS = TABLE["plan"]["PATTERN"]["choices"]


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
    *(unless(option, ("GSD",)) for option in listed("plan", "ALTITUDE")),
    place(
        "HOME",
        "Home",
        "Where the vehicle takes off. Empty: a place outside of the regions, which you must look at.",
        True,
        _home,
        "--home",
    ),
    Option(
        lambda: definition("HOME_ALTITUDE", "metres", {"label": "Height of home above the sea"}),
        lambda _: [],
        "Of home above the sea. Empty: written as 0, which formats that need it cannot use.",
    ),
    *listed(
        "plan",
        *("PATTERN", "SPACING", "CAMERA", "GSD", "OVERLAP", "AVOID", "AVOID_MARGIN", "AUTOPILOT", "SPEED"),
        *("ZONE_WIDTH", "ZONE_HEIGHT"),
        *("ANGLE", "RASTER", "ALLOW_EDGE", "DEM", "TERRAIN", "ENDURANCE", "RESERVE", "MAX_ALTITUDE"),
        *("MAX_DISTANCE", "FENCE", "WHERE", "LARGEST", "VEHICLE", "TRIGGER", "CROSSHATCH", "EDITABLE"),
    ),
)


class PlanMission(ProgramAlgorithm):
    """`uavseg plan`."""

    NAME = "plan"
    TITLE = "Plan mission"
    GROUP = GROUP
    SUMMARY = (
        "Plans a flight over regions: take-off at home, every region in a short order, return. The file "
        "is for "
        "QGroundControl (.plan), Mission Planner (.waypoints), DJI Pilot 2 (.kmz) or Litchi (.csv). Look "
        "at the legs before you "
        "fly: the plan knows nothing of trees, wires or roads."
    )
    TAGS = ("mission", "survey", "waypoints", "flight", "mavlink", "photogrammetry")

    def options(self) -> Sequence[Option]:
        return PLAN_OPTIONS

    def add_outputs(self) -> None:
        self.addParameter(QgsProcessingParameterFileDestination("OUTPUT", "Mission", TARGET_FILTER))
        self.addParameter(
            QgsProcessingParameterFeatureSink("LEGS", "Legs", QgsProcessing.TypeVectorLine, None, True)
        )
        for name, label in _NUMBERS.items():
            self.addOutput(QgsProcessingOutputNumber(name, label))

    def answer(self, values: Values) -> dict[str, Any]:
        target = self.file_target(values, "OUTPUT", MISSION_EXTENSIONS)
        words = ["plan", *words_of(self.options(), values), *self._regions(values)]
        finished = self.succeed(
            values,
            [*words[:-2], f"--output={target}", "--overwrite", "--json", *words[-2:]],
            show_output=False,
        )
        found = json.loads(finished.output)
        for warning in found["warnings"]:
            values.feedback.pushWarning(warning)
        folder = Path(target).parent
        results: dict[str, Any] = {"OUTPUT": str(folder / found["flights"][0]["file"]), **_totals(found)}
        for flight in found["flights"]:
            values.feedback.pushInfo(_line(flight))
        if len(found["flights"]) > 1:
            values.feedback.pushWarning(
                f"the mission is divided into {len(found['flights'])} flights, each in a file of its own "
                f"in {folder}"
            )
        legs = self._legs(values, words)
        return {**results, "LEGS": legs} if legs else results

    def _regions(self, values: Values) -> list[str]:
        """The file of the regions and its layer, last on the command line."""
        layer = self.parameterAsVectorLayer(values.parameters, "REGIONS", values.context)
        if layer is not None:
            refuse_unsaved(layer, values.label("REGIONS"))
        path, name = self.parameterAsCompatibleSourceLayerPathAndLayerName(
            values.parameters,
            "REGIONS",
            values.context,
            ["gpkg", "geojson", "fgb", "shp"],
            "gpkg",
            values.feedback,
        )
        return [*([f"--layer={name}"] if name else []), "--", path]

    def _legs(self, values: Values, words: list[str]) -> str:
        """The legs as a layer, from the same plan as GeoJSON; empty if they were not asked for."""
        if not values.given("LEGS"):
            return ""
        target = Path(QgsProcessingUtils.generateTempFilename("mission.geojson"))
        shown = [*words[:-2], f"--output={target}", "--overwrite", "--json", *words[-2:]]
        finished = run(str(ready_program()), shown, values.feedback, show_output=False)
        if finished.code:
            raise QgsProcessingException(
                f"the mission is written, its legs cannot be shown: {finished.error()}"
            )
        files = [target.parent / flight["file"] for flight in json.loads(finished.output)["flights"]]
        sink, name = self.parameterAsSink(values.parameters, "LEGS", values.context, LEG_FIELDS, *WGS84)
        if sink is None:
            raise QgsProcessingException(self.invalidSinkError(values.parameters, "LEGS"))
        for feature in leg_features(files):
            sink.addFeature(feature)
        style_on_load(name, self.styles.legs, values.context)
        return name


def _totals(found: dict[str, Any]) -> dict[str, Any]:
    flights = found["flights"]
    sums = {
        name: sum(flight[name.lower()] for flight in flights)
        for name in ("DISTANCE_M", "DURATION_S", "PHOTOGRAPHS")
    }
    return {"FLIGHTS": len(flights), **sums}


def _line(flight: dict[str, Any]) -> str:
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
