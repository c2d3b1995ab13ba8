"""Options of the command line as parameters of Processing: one definition, one rule for its words.

A parameter that is left empty gives no words, so that the defaults are those of the program.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
    """A parameter, and the words on the command line that its value becomes."""

    make: Callable[[], QgsProcessingParameterDefinition]
    words: Callable[[Values], list[str]]
    help: str
    advanced: bool = True

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


def number(
    name: str, label: str, flag: str, help: str, least: float | None = None, integer: bool = False
) -> Option:
    """An optional number."""
    kind = QgsProcessingParameterNumber.Integer if integer else QgsProcessingParameterNumber.Double

    def make() -> QgsProcessingParameterDefinition:
        definition = QgsProcessingParameterNumber(name, label, kind, None, True)
        if least is not None:
            definition.setMinimum(least)
        return definition

    return Option(make, lambda v: [f"{flag}={plain(v.number(name))}"] if v.given(name) else [], help)


def metres(
    name: str, label: str, flag: str, help: str, default: float | None = None, least: float = 0.0
) -> Option:
    """An optional distance in metres; the dialog takes other units and converts them."""

    def make() -> QgsProcessingParameterDefinition:
        definition = QgsProcessingParameterDistance(name, label, default, "", True, least)
        definition.setDefaultUnit(QgsUnitTypes.DistanceMeters)
        return definition

    return Option(make, lambda v: [f"{flag}={plain(v.number(name))}"] if v.given(name) else [], help)


def shown(option: Option) -> Option:
    """An option that stands above the fold of the dialog."""
    return replace(option, advanced=False)


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


def text(name: str, label: str, flag: str, help: str, advanced: bool = True) -> Option:
    """An optional text that is passed as it is."""
    return Option(
        lambda: QgsProcessingParameterString(name, label, None, False, True),
        lambda v: [f"{flag}={v.text(name)}"] if v.given(name) and v.text(name) else [],
        help,
        advanced,
    )


def switch(name: str, label: str, flag: str, help: str) -> Option:
    """A tick box, empty by default."""

    def words(values: Values) -> list[str]:
        ticked = values.algorithm.parameterAsBool(values.parameters, name, values.context)
        return [flag] if ticked else []

    return Option(lambda: QgsProcessingParameterBoolean(name, label, False, True), words, help)


def choice(
    name: str, label: str, flag: str, help: str, values: Sequence[str], default: str | None = None
) -> Option:
    """One of the words of an option; empty: the default of the program."""

    def words(entered: Values) -> list[str]:
        if not entered.given(name):
            return []
        chosen = entered.algorithm.parameterAsEnumString(entered.parameters, name, entered.context)
        return [f"{flag}={chosen}"] if chosen else []

    def make() -> QgsProcessingParameterDefinition:
        return QgsProcessingParameterEnum(name, label, list(values), False, default, default is None, True)

    return Option(make, words, help, advanced=default is None)


def file(name: str, label: str, flag: str, help: str, pattern: str) -> Option:
    """An optional file."""
    return Option(
        lambda: QgsProcessingParameterFile(
            name, label, QgsProcessingParameterFile.File, "", None, True, pattern
        ),
        lambda v: [f"{flag}={v.text(name)}"] if v.given(name) else [],
        help,
    )


def raster(name: str, label: str, flag: str, help: str) -> Option:
    """An optional raster layer."""
    return Option(
        lambda: QgsProcessingParameterRasterLayer(name, label, None, True),
        lambda v: [f"{flag}={v.raster(name)}"] if v.given(name) else [],
        help,
    )


def polygons(name: str, label: str, flag: str, help: str, advanced: bool = False) -> Option:
    """Optional layers of polygons, each an option of its own."""

    def words(values: Values) -> list[str]:
        if not values.given(name):
            return []
        layers = values.algorithm.parameterAsLayerList(values.parameters, name, values.context)
        return [f"{flag}={polygon_file(layer, label, values.context)}" for layer in layers]

    return Option(
        lambda: QgsProcessingParameterMultipleLayers(
            name, label, QgsProcessing.TypeVectorPolygon, None, True
        ),
        words,
        help,
        advanced,
    )


def band(name: str = "BAND", of: str = "INPUT") -> Option:
    """An optional band of a raster; empty: what the program takes by itself."""
    return Option(
        lambda: QgsProcessingParameterBand(name, "Band", None, of, True),
        lambda v: [f"--band={plain(v.number(name))}"] if v.given(name) else [],
        "The band. Empty: the only one, or the luminance of red, green and blue.",
        advanced=False,
    )


RANGE_FLAGS = ("--range", "--values", "--percentile")


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
        return [f"{RANGE_FLAGS[counts]}={low},{high}"]

    return [
        Option(
            lambda: QgsProcessingParameterRange(
                "RANGE", "Range", QgsProcessingParameterNumber.Double, default, True
            ),
            words,
            help,
            advanced=False,
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
