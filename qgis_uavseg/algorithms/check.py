"""Check a mission: what it holds, and who would refuse it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsProcessingException,
    QgsProcessingOutputBoolean,
    QgsProcessingOutputNumber,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
)

from ..options import Option, Values, listed, words_of
from .base import ProgramAlgorithm
from .plan import GROUP, MISSION_FILTER


class CheckMission(ProgramAlgorithm):
    """`uavseg check`."""

    NAME = "check"
    TITLE = "Check mission"
    GROUP = GROUP
    SUMMARY = (
        "Reads a mission file back, and says what it holds, how long it takes, and which autopilots, "
        "programs and aircraft "
        "would refuse it. The algorithm fails where the mission must not be flown, and says why."
    )
    TAGS = ("mission", "safety", "mavlink", "ardupilot", "px4")

    def options(self) -> Sequence[Option]:
        return (
            Option(
                lambda: QgsProcessingParameterFile(
                    "INPUT", "Mission", QgsProcessingParameterFile.File, "", None, False, MISSION_FILTER
                ),
                lambda _: [],
                "A mission file: .plan, .waypoints, .kmz, .csv, .kml or .geojson.",
                advanced=False,
            ),
            *listed("check", "AUTOPILOT", "AVOID", "AVOID_MARGIN", "ZONE_WIDTH", "ZONE_HEIGHT"),
            *listed("check", "MAX_ALTITUDE", "MAX_DISTANCE", "DEM"),
        )

    def add_outputs(self) -> None:
        self.addParameter(
            QgsProcessingParameterFileDestination("REPORT", "Report", "JSON (*.json)", None, True, False)
        )
        self.addOutput(QgsProcessingOutputBoolean("OK", "Whether it may be flown"))
        for name, label in _NUMBERS.items():
            self.addOutput(QgsProcessingOutputNumber(name, label))

    def answer(self, values: Values) -> dict[str, Any]:
        mission = str(Path(values.text("INPUT")).absolute())
        report = self.file_target(values, "REPORT", ("json",))
        words = ["check", "--json", *words_of(self.options(), values), "--", mission]
        finished = self.command(values, words, show_output=False)
        if not finished.output.strip():
            raise QgsProcessingException(finished.error())
        if report:
            Path(report).write_bytes(finished.output.encode("utf-8"))
        found = json.loads(finished.output)
        for warning in found["warnings"]:
            values.feedback.pushWarning(warning)
        for verdict in found["verdicts"]:
            said = "accepts it" if verdict["accepts"] else f"refuses it: {verdict['reason']}"
            values.feedback.pushInfo(f"{verdict['who']} {said}")
        if finished.code or not found["ok"]:
            raise QgsProcessingException("; ".join(found["problems"]) or finished.error())
        numbers = {name: found[name.lower()] for name in _NUMBERS}
        return {"OK": True, **numbers, **({"REPORT": report} if report else {})}


_NUMBERS = {
    "ITEMS": "Items",
    "WAYPOINTS": "Waypoints",
    "DISTANCE_M": "Length in metres",
    "DURATION_S": "Time in seconds",
    "PHOTOGRAPHS": "Photographs",
    "HIGHEST_M": "Greatest height in metres",
}
