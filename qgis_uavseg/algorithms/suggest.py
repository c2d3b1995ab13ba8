"""Suggest ranges of intensity, as a table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any, ClassVar

from qgis.core import (
    QgsProcessingOutputNumber,
    QgsProcessingOutputString,
    QgsProcessingParameterFileDestination,
)

from ..options import Option, Values, listed, words_of
from ..reading import DIVISION, RASTER
from .base import ProgramAlgorithm
from .regions import GROUP, with_input


class SuggestRanges(ProgramAlgorithm):
    """`uavseg suggest`."""

    OUTPUT_FLAGS: ClassVar = {"-o": "PICTURE", "--output": "PICTURE"}
    NAME = "suggest"
    TITLE = "Suggest ranges"
    GROUP = GROUP
    SUMMARY = (
        "Proposes ranges of intensity for Extract regions, each with its share of the area and the "
        "number of regions that it gives: classes of the histogram, and small things that stand out in the "
        "darkest or the brightest of them. What looks most like things on a ground comes first."
    )
    TAGS = ("histogram", "otsu", "threshold")

    def options(self) -> Sequence[Option]:
        return with_input(
            listed("suggest", "CLASSES"),
            RASTER,
            listed("suggest", "FLATTEN"),
            DIVISION,
            listed("suggest", "THREADS"),
        )

    def add_outputs(self) -> None:
        add = self.addParameter
        add(QgsProcessingParameterFileDestination("REPORT", "Table", "HTML (*.html)", None, True))
        add(
            QgsProcessingParameterFileDestination(
                "JSON", "Table for programs", "JSON (*.json)", None, True, False
            )
        )
        add(
            QgsProcessingParameterFileDestination(
                "PICTURE", "Picture of the histogram", "PNG (*.png)", None, True, False
            )
        )
        self.addOutput(QgsProcessingOutputNumber("COUNT", "Number of ranges"))
        self.addOutput(QgsProcessingOutputString("RANGES", "Ranges of v, such as 0,0.5;0.5,1"))

    def answer(self, values: Values) -> dict[str, Any]:
        source = values.raster("INPUT")
        report = self.file_target(values, "REPORT", ("html", "htm"))
        table = self.file_target(values, "JSON", ("json",))
        picture = self.file_target(values, "PICTURE", ("png",))
        words = ["suggest", "--json", *words_of(self.options(), values)]
        words += [f"--output={picture}", "--overwrite"] if picture else []
        output = self.succeed(values, [*words, "--progress=plain", "--", source], show_output=False).output
        found = json.loads(output)
        for warning in found["warnings"]:
            values.feedback.pushWarning(warning)
        for line in _lines(found["ranges"]):
            values.feedback.pushInfo(line)
        results: dict[str, Any] = {"COUNT": len(found["ranges"])}
        results["RANGES"] = ";".join(f"{part['low']:g},{part['high']:g}" for part in found["ranges"])
        if table:
            Path(table).write_bytes(output.encode("utf-8"))
        if report:
            Path(report).write_text(_html(found), encoding="utf-8")
        named = {"REPORT": report, "JSON": table, "PICTURE": picture}
        return {**results, **{name: path for name, path in named.items() if path}}


def _lines(ranges: list[dict[str, Any]]) -> list[str]:
    return [
        f"{part['low']:g} to {part['high']:g}: {100 * part['share']:.1f} % of the area, {_count(part)} "
        f"regions, contrast {_contrast(part)}"
        for part in ranges
    ]


def _html(found: dict[str, Any]) -> str:
    """The table as a page; all texts of files are escaped."""
    rows = "".join(
        f"<tr><td>{part['low']:g},{part['high']:g}</td><td>{escape(_values(part))}</td>"
        f"<td>{100 * part['share']:.1f} %</td><td>{_count(part)}</td><td>{_contrast(part)}</td></tr>"
        for part in found["ranges"]
    )
    return (
        f'<!DOCTYPE html><html><head><meta charset="utf-8">'
        f"<title>Ranges of {escape(found['source'])}</title></head>"
        f"<body><p>Ranges of v for {escape(found['source'])}, stretch {escape(found['stretch'])}:</p>"
        '<table border="1" cellpadding="4"><tr>'
        "<th>Range of v</th><th>Values</th><th>Area</th><th>Regions</th><th>Contrast</th></tr>"
        f"{rows}</table></body></html>\n"
    )


def _count(part: dict[str, Any]) -> str:
    return f"{part['regions']:,}" if part["exact"] else f"about {part['regions']:,}"


def _values(part: dict[str, Any]) -> str:
    """The range in the units of the raster, as far as they are known."""
    low, high, unit = part["value_low"], part["value_high"], part["unit"]
    if low is None and high is None:
        return ""
    if low is None or high is None:
        return f"{low:g} and more {unit}" if high is None else f"{high:g} and less {unit}"
    return f"{low:g} to {high:g} {unit}"


def _contrast(part: dict[str, Any]) -> str:
    """How much the range stands out at its borders, and whether it is a part of another one."""
    text = "not known" if part["contrast"] is None else f"{part['contrast']:.1f}"
    return text + (" (part)" if part["part"] else "")
