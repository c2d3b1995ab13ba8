"""Suggest a range for a sample: the band or formula, and its values, that part the sample best."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsProcessingOutputNumber,
    QgsProcessingOutputString,
    QgsProcessingParameterFileDestination,
)

from ..options import Option, Values, listed, words_of
from .base import ProgramAlgorithm
from .regions import GROUP, with_input
from .sample import SAMPLE, sample_word

_WORDS = {"BAND": "band", "INDEX": "index", "EXPRESSION": "expr"}  # outputs, and what the program calls them


class SuggestForSample(ProgramAlgorithm):
    """`uavseg suggest --like`."""

    NAME = "suggestlike"
    TITLE = "Suggest a range for a sample"
    GROUP = GROUP
    SUMMARY = (
        "Looks at all bands, indices, ratios and weighted sums of bands, and proposes the one whose range of "
        "values parts a sample best from the rest of the raster, with the agreement that is expected. "
        "Extract regions takes the band or formula, and the range of values."
    )
    TAGS = ("index", "threshold", "sample", "bands")

    def options(self) -> Sequence[Option]:
        return with_input(SAMPLE, listed("suggest", "UNLIKE", "BANDS", "BAND_NAMES", "NODATA", "THREADS"))

    def add_outputs(self) -> None:
        add = self.addParameter
        add(QgsProcessingParameterFileDestination("REPORT", "Table", "HTML (*.html)", None, True))
        add(
            QgsProcessingParameterFileDestination(
                "JSON", "Table for programs", "JSON (*.json)", None, True, False
            )
        )
        self.addOutput(QgsProcessingOutputNumber("COUNT", "Number of proposals"))
        self.addOutput(QgsProcessingOutputString("RANGE", "Range of values of the best, such as ,108.5"))
        self.addOutput(QgsProcessingOutputString("BAND", "Band of the best, if it is one"))
        self.addOutput(QgsProcessingOutputString("INDEX", "Index of the best, if it is one"))
        self.addOutput(QgsProcessingOutputString("EXPRESSION", "Formula of the best, if it is one"))

    def answer(self, values: Values) -> dict[str, Any]:
        source = values.raster("INPUT")
        report = self.file_target(values, "REPORT", ("html", "htm"))
        table = self.file_target(values, "JSON", ("json",))
        words = ["suggest", "--json", *words_of(self.options(), values), sample_word(values)]
        output = self.succeed(values, [*words, "--progress=plain", "--", source], show_output=False).output
        found = json.loads(output)
        for warning in found["warnings"]:
            values.feedback.pushWarning(warning)
        for one in found["ranges"]:
            values.feedback.pushInfo(
                f"{one['of']}, values {_range(one)}: agreement {one['agreement']:.2f}, "
                f"{100 * one['share']:.1f} % of the area"
            )
        if table:
            Path(table).write_bytes(output.encode("utf-8"))
        if report:
            Path(report).write_text(_html(found), encoding="utf-8")
        results: dict[str, Any] = {"COUNT": len(found["ranges"]), **_best(found["ranges"])}
        named = {"REPORT": report, "JSON": table}
        return {**results, **{name: path for name, path in named.items() if path}}


def _best(ranges: list[dict[str, Any]]) -> dict[str, str]:
    """The first proposal, in the words of Extract regions."""
    if not ranges:
        return {}
    words = ranges[0]["words"]
    return {"RANGE": _range(ranges[0]), **{name: str(words.get(word, "")) for name, word in _WORDS.items()}}


def _range(one: dict[str, Any]) -> str:
    return ",".join("" if end is None else f"{end:.10g}" for end in (one["value_low"], one["value_high"]))


def _html(found: dict[str, Any]) -> str:
    """The table as a page; all texts of files are escaped."""
    rows = "".join(
        f"<tr><td>{escape(one['of'])}</td><td>{_range(one)} {escape(str(one['unit']))}</td>"
        f"<td>{one['agreement']:.2f}</td><td>{100 * one['share']:.1f} %</td></tr>"
        for one in found["ranges"]
    )
    return (
        f'<!DOCTYPE html><html><head><meta charset="utf-8">'
        f"<title>Ranges of a sample in {escape(found['source'])}</title></head>"
        f"<body><p>What parts the sample from the rest of {escape(found['source'])}:</p>"
        '<table border="1" cellpadding="4"><tr>'
        "<th>Band or formula</th><th>Values</th><th>Agreement</th><th>Area</th></tr>"
        f"{rows}</table></body></html>\n"
    )
