"""What all algorithms share: parameters, help, running the program, errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from qgis.core import QgsProcessingAlgorithm, QgsProcessingException, QgsProcessingMultiStepFeedback
from qgis.PyQt.QtGui import QIcon

from ..flags import field_name, in_dialog
from ..options import Option, Values
from ..process import Cancelled, Finished, ProcessError, run
from ..program import ProgramError, ready_program
from ..styles import fresh_styles
from ..targets import checked_target


class DialogFeedback(QgsProcessingMultiStepFeedback):
    """Feedback that passes everything on, with the fields of a dialog in messages that name flags.

    A warning is shown once: commands give theirs on stderr and in their JSON, and legs are planned again.

    Parameters
    ----------
    feedback : QgsProcessingFeedback
    fields : mapping of str to str
        What to write for a flag; see `in_dialog`.
    """

    def __init__(self, feedback: Any, fields: Mapping[str, str]) -> None:
        super().__init__(1, feedback)
        self._fields = fields
        self._warned: set[str] = set()
        if feedback.isCanceled():
            self.cancel()

    def pushInfo(self, info: str) -> None:
        super().pushInfo(in_dialog(info, self._fields))

    def pushWarning(self, warning: str) -> None:
        text = in_dialog(warning, self._fields)
        if text not in self._warned:
            self._warned.add(text)
            super().pushWarning(text)

    def reportError(self, error: str, fatalError: bool = False) -> None:
        super().reportError(in_dialog(error, self._fields), fatalError)


class ProgramAlgorithm(QgsProcessingAlgorithm):
    """An algorithm that runs a command of `uavseg`."""

    NAME = ""
    TITLE = ""
    GROUP: tuple[str, str] = ("", "")
    SUMMARY = ""
    TAGS: tuple[str, ...] = ()
    OUTPUT_FLAGS: ClassVar[Mapping[str, str]] = {
        "-o": "OUTPUT",
        "--output": "OUTPUT",
        "--labels": "LABELS",
        "--objects": "OBJECTS",
    }

    def options(self) -> Sequence[Option]:
        """The parameters that become words of the command, in the order of the dialog."""
        raise NotImplementedError

    def add_outputs(self) -> None:
        """Add the parameters of outputs, and outputs."""
        raise NotImplementedError

    def answer(self, values: Values) -> dict[str, Any]:
        """Run the command; its results."""
        raise NotImplementedError

    def initAlgorithm(self, configuration: Any = None) -> None:
        for option in self.options():
            self.addParameter(option.parameter())
        self.add_outputs()

    def prepareAlgorithm(self, parameters: dict[str, Any], context: Any, feedback: Any) -> bool:
        self.styles = fresh_styles()  # in the main thread, which a run may leave
        return True

    def processAlgorithm(self, parameters: dict[str, Any], context: Any, feedback: Any) -> dict[str, Any]:
        values = Values.of(self, parameters, context, feedback)
        fields = self.fields(values)
        try:
            return self.answer(replace(values, feedback=DialogFeedback(feedback, fields)))
        except Cancelled:
            return {}
        except (ProcessError, ProgramError) as error:
            raise QgsProcessingException(str(error)) from error
        except QgsProcessingException as error:
            raise QgsProcessingException(in_dialog(str(error), fields)) from error

    def fields(self, values: Values) -> dict[str, str]:
        """The fields of the dialog by flag; of several for a flag, one that is filled in."""
        found: dict[str, str] = {}
        for option in self.options():
            definition = option.make()
            if values.given(definition.name()) or not found.keys() & option.flags:
                name = field_name(definition.description())
                found.update((flag, name + more) for flag, more in option.flags.items())
        outputs = {one.name(): one for one in self.parameterDefinitions() if one.isDestination()}
        shown = {flag: name for flag, name in self.OUTPUT_FLAGS.items() if name in outputs}
        return {**{flag: field_name(outputs[name].description()) for flag, name in shown.items()}, **found}

    def command(self, values: Values, words: Sequence[str], show_output: bool = True) -> Finished:
        """Run the program, whatever its exit code.

        Raises
        ------
        ProgramError, ProcessError, Cancelled
        """
        return run(str(ready_program()), list(words), values.feedback, show_output)

    def succeed(self, values: Values, words: Sequence[str], show_output: bool = True) -> Finished:
        """Run the program.

        Raises
        ------
        QgsProcessingException
            If it ends with an error; the text is what it says.
        ProgramError, ProcessError, Cancelled
        """
        finished = self.command(values, words, show_output)
        if finished.code:
            raise QgsProcessingException(finished.error())
        return finished

    def target(self, values: Values, name: str, extensions: Sequence[str]) -> str:
        """The file of an output that becomes a layer; empty if it was not asked for."""
        target = self.parameterAsOutputLayer(values.parameters, name, values.context)
        return checked_target(target, extensions, values.label(name)) if target else ""

    def file_target(self, values: Values, name: str, extensions: Sequence[str]) -> str:
        """The file of an output that becomes no layer; empty if it was not asked for."""
        target = self.parameterAsFileOutput(values.parameters, name, values.context)
        return checked_target(target, extensions, values.label(name)) if target else ""

    def canExecute(self) -> tuple[bool, str]:
        try:
            ready_program()
        except ProgramError as error:
            return False, str(error)
        return True, ""

    def name(self) -> str:
        return self.NAME

    def displayName(self) -> str:
        return self.TITLE

    def group(self) -> str:
        return self.GROUP[1]

    def groupId(self) -> str:
        return self.GROUP[0]

    def tags(self) -> list[str]:
        return [*self.TAGS, "uav", "drone", "uavseg"]

    def shortDescription(self) -> str:
        return self.SUMMARY.split(". ")[0]

    def shortHelpString(self) -> str:
        listed = "".join(
            f"<p><b>{definition.description()}</b><br>{definition.help()}</p>"
            for definition in self.parameterDefinitions()
            if definition.help()
        )
        return f"<p>{self.SUMMARY}</p>{listed}"

    def icon(self) -> QIcon:
        from ..provider import ICON

        return QIcon(str(ICON))

    def svgIconPath(self) -> str:
        from ..provider import ICON

        return str(ICON)

    def createInstance(self) -> ProgramAlgorithm:
        return type(self)()
