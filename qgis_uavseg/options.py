"""Options of the command line as parameters of Processing, from the table that the program's options are in.

A parameter that is left empty gives no words, so that the defaults are those of the program.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Callable

from qgis.core import (
    QgsProcessing,
    QgsProcessingException,
    QgsProcessingParameterBand,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterDistance,
    QgsProcessingParameterEnum,
    QgsProcessingParameterFile,
    QgsProcessingParameterMultipleLayers,
    QgsProcessingParameterNumber,
    QgsProcessingParameterRange,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterString,
    QgsUnitTypes,
)
from qgis.PyQt.QtCore import QVariant

from .targets import polygon_file, raster_file


@dataclass(frozen=True)
class Values:
    """What the user entered: the parameters of one run, with the defaults of those that were not named."""

    algorithm: Any
    parameters: dict[str, Any]
    context: Any
    feedback: Any

    @classmethod
    def of(cls, algorithm: Any, parameters: dict[str, Any], context: Any, feedback: Any) -> Values:
        """The values of a run. QGIS 3.22 does not fill in the defaults of ranges and bands by itself."""
        defaults = {
            definition.name(): definition.defaultValue()
            for definition in algorithm.parameterDefinitions()
            if not definition.isDestination() and definition.defaultValue() is not None
        }
        return cls(algorithm, {**defaults, **parameters}, context, feedback)

    def given(self, name: str) -> bool:
        """Whether a parameter is not left empty. An empty table comes from a dialog as [NULL]."""
        value = self.parameters.get(name)
        return any(map(filled, value)) if isinstance(value, (list, tuple)) else filled(value)

    def text(self, name: str) -> str:
        return self.algorithm.parameterAsString(self.parameters, name, self.context).strip()

    def number(self, name: str) -> float:
        return self.algorithm.parameterAsDouble(self.parameters, name, self.context)

    def raster(self, name: str) -> str:
        """The file of a raster layer."""
        layer = self.algorithm.parameterAsRasterLayer(self.parameters, name, self.context)
        if layer is None or not layer.isValid():
            raise QgsProcessingException(self.algorithm.invalidRasterError(self.parameters, name))
        return raster_file(layer, self.label(name), self.feedback)

    def label(self, name: str) -> str:
        return self.algorithm.parameterDefinition(name).description()


@dataclass(frozen=True)
class Option:
    """A parameter, and the words on the command line that its value becomes.

    `flags` are those of the words, each with what messages write behind the label of the parameter for it.
    """

    make: Callable[[], QgsProcessingParameterDefinition]
    words: Callable[[Values], list[str]]
    help: str
    advanced: bool = True
    flags: Mapping[str, str] = field(default_factory=dict)

    def parameter(self) -> QgsProcessingParameterDefinition:
        """The definition, with its help."""
        definition = self.make()
        definition.setHelp(self.help)
        if self.advanced:
            definition.setFlags(definition.flags() | QgsProcessingParameterDefinition.FlagAdvanced)
        return definition


def filled(value: Any) -> bool:
    """Whether a value is neither None, an empty text, nor the NULL of Qt."""
    return value is not None and value != "" and not (isinstance(value, QVariant) and value.isNull())


def plain(value: float) -> str:
    """A number as one types it: the shortest text with the same value.

    Raises
    ------
    QgsProcessingException
        If it is not finite.
    """
    if not math.isfinite(value):
        raise QgsProcessingException(f"expected a number, not {value}")
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


TABLE = json.loads(Path(__file__).with_name("options.json").read_text(encoding="utf-8"))
LAYERS = {"RASTER": "raster", "DEM": "raster", "AVOID": "polygons", "UNLIKE": "polygons"}  # in place of text
FILTERS = {"CLASSES_FILE": "Classes (*.csv *.yaml *.yml)", "VEHICLE": "Vehicle (*.json)"}
SMALLEST = {"THRESHOLD": 1, "THREADS": 1, "LARGEST": 1, "HOME_ALTITUDE": -500}  # of numbers; of others 0
DEFAULTS = {"ALTITUDE": 60}


def listed(command: str, *names: str) -> list[Option]:
    """Return options of a command as the table of options describes them.

    Parameters
    ----------
    command : str
    *names : str
        Of parameters, in the order of the dialog.
    """
    return [_listed(name, TABLE[command][name]) for name in names]


def _listed(name: str, one: dict[str, Any]) -> Option:
    kind, flag, label = LAYERS.get(name, one["kind"]), one["flag"], one["label"]

    def words(values: Values) -> list[str]:
        if kind == "switch":
            return [flag] * values.algorithm.parameterAsBool(values.parameters, name, values.context)
        if not values.given(name):
            return []
        if kind == "polygons":
            layers = values.algorithm.parameterAsLayerList(values.parameters, name, values.context)
            return [f"{flag}={polygon_file(layer, label, values.context)}" for layer in layers]
        if kind == "choice":
            text = values.algorithm.parameterAsEnumString(values.parameters, name, values.context)
        elif kind == "raster":
            text = values.raster(name)
        else:
            text = values.text(name) if kind in ("text", "file") else plain(values.number(name))
        return [f"{flag}={text}"] if text else []

    return Option(lambda: definition(name, kind, one), words, one["help"], not one["basic"], {flag: ""})


def definition(name: str, kind: str, one: Mapping[str, Any]) -> QgsProcessingParameterDefinition:
    """Return the parameter, which may be left empty."""
    label, default, smallest = one["label"], DEFAULTS.get(name), SMALLEST.get(name, 0)
    if kind == "switch":
        return QgsProcessingParameterBoolean(name, label, False, True)
    if kind == "polygons":
        polygon = QgsProcessing.TypeVectorPolygon
        return QgsProcessingParameterMultipleLayers(name, label, polygon, None, True)
    if kind == "raster":
        return QgsProcessingParameterRasterLayer(name, label, None, True)
    if kind == "choice":
        return QgsProcessingParameterEnum(name, label, one["choices"], False, None, True, True)
    if kind == "text":
        return QgsProcessingParameterString(name, label, None, False, True)
    if kind == "file":
        file = QgsProcessingParameterFile.File
        return QgsProcessingParameterFile(name, label, file, "", None, True, FILTERS[name])
    if kind == "metres":  # the dialog takes other units and converts them
        definition = QgsProcessingParameterDistance(name, label, default, "", True, smallest)
        definition.setDefaultUnit(QgsUnitTypes.DistanceMeters)
        return definition
    number = (
        QgsProcessingParameterNumber.Integer if kind == "integer" else QgsProcessingParameterNumber.Double
    )
    return QgsProcessingParameterNumber(name, label, number, None, True, smallest)


def unless(option: Option, others: Sequence[str]) -> Option:
    """An option whose default gives way where one of the others is given.

    A value that differs from the default stays, and the program decides on the conflict.
    """

    def words(values: Values) -> list[str]:
        found = option.words(values)
        given = [values.label(name) for name in others if values.given(name)]
        definition = option.make()
        entered = values.parameters.get(definition.name())
        if found and given and str(entered) in (str(definition.defaultValue()), plain_or_text(definition)):
            values.feedback.pushInfo(f"{definition.description()} is left out: {given[0]} is given")
            return []
        return found

    return replace(option, words=words)


def plain_or_text(definition: QgsProcessingParameterDefinition) -> str:
    """The default of a parameter, as one types it."""
    default = definition.defaultValue()
    return plain(default) if isinstance(default, (int, float)) else str(default)


def band(name: str = "BAND", of: str = "INPUT") -> Option:
    """An optional band of a raster; empty: what the program takes by itself."""
    return Option(
        lambda: QgsProcessingParameterBand(name, "Band", None, of, True),
        lambda v: [f"--band={plain(v.number(name))}"] if v.given(name) else [],
        "The band. Empty: the only one, or the luminance of red, green and blue.",
        advanced=False,
        flags=dict.fromkeys(("-b", "--band", "--bidx"), ""),
    )


RANGE_FLAGS = {"--range": "", "--values": " in values of the raster", "--percentile": " in percentiles"}


def interval(default: str, help: str) -> list[Option]:
    """A range, and what its numbers count: v, values of the raster or percentiles.

    It is optional because QGIS 3.22 does not take the default of a range that is not.
    """

    def words(values: Values) -> list[str]:
        if not values.given("RANGE"):
            return []
        ends = values.algorithm.parameterAsRange(values.parameters, "RANGE", values.context)
        counts = values.algorithm.parameterAsEnum(values.parameters, "RANGE_IN", values.context)
        low, high = ("" if math.isnan(end) else plain(end) for end in ends)
        return [f"{list(RANGE_FLAGS)[counts]}={low},{high}"]

    return [
        Option(
            lambda: QgsProcessingParameterRange(
                "RANGE", "Range", QgsProcessingParameterNumber.Double, default, True
            ),
            words,
            help,
            advanced=False,
            flags=RANGE_FLAGS,
        ),
        Option(
            lambda: QgsProcessingParameterEnum(
                "RANGE_IN",
                "The range is in",
                ["intensity v (0 to 1)", "values of the raster", "percentiles (0 to 100)"],
                False,
                0,
            ),
            lambda _: [],
            "v is intensity scaled to 0..1; values are in the raster's own units; percentiles rank all "
            "valid "
            "pixels.",
            advanced=False,
        ),
    ]


def words_of(options: Sequence[Option], values: Values) -> list[str]:
    """The words of all options, in their order."""
    return [word for option in options for word in option.words(values)]
