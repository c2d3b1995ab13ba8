"""Options > UAV Segmentation: the path of the program, what it is, and the button that installs it."""

from __future__ import annotations

from pathlib import Path

from qgis.core import Qgis, QgsApplication, QgsFeedback, QgsSettings, QgsTask
from qgis.gui import QgsFileWidget, QgsOptionsPageWidget, QgsOptionsWidgetFactory
from qgis.PyQt.QtCore import Qt, pyqtSignal
from qgis.PyQt.QtGui import QIcon
from qgis.PyQt.QtWidgets import (
    QFormLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from .install import InstallError, install
from .process import Cancelled
from .program import REQUIREMENT, REQUIREMENT_SETTING, SETTING, ProgramError, ready_program, version_of
from .provider import ICON

TITLE = "UAV Segmentation"


class TaskFeedback(QgsFeedback):
    """Feedback with the messages of Processing, as signals that may cross threads."""

    said = pyqtSignal(str)

    def pushInfo(self, text: str) -> None:
        """Say a line."""
        self.said.emit(text)

    pushWarning = pushCommandInfo = pushInfo  # noqa: N815 - names of Qt


class InstallTask(QgsTask):
    """`install` in a worker thread; it can be cancelled as every task."""

    def __init__(self) -> None:
        super().__init__("Install uavseg", QgsTask.CanCancel)
        self.feedback = TaskFeedback()
        self.feedback.progressChanged.connect(self.setProgress)
        self.error = ""

    def run(self) -> bool:
        try:
            install(self.feedback)
        except InstallError as error:
            self.error = str(error)
            return False
        except Cancelled:
            self.error = "cancelled; nothing was changed"
            return False
        return True

    def cancel(self) -> None:
        self.feedback.cancel()
        super().cancel()


class ProgramPanel(QWidget):
    """Where the program is, which version, and a button that installs it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.path = QgsFileWidget()
        self.path.setFilePath(str(QgsSettings().value(SETTING, "") or ""))
        self.path.lineEdit().setPlaceholderText("empty: found by itself")
        self.requirement = QLineEdit(str(QgsSettings().value(REQUIREMENT_SETTING, "") or ""))
        self.requirement.setPlaceholderText(REQUIREMENT)
        self.state, self.log, self.bar = QLabel(), QPlainTextEdit(), QProgressBar()
        self.state.setWordWrap(True)
        self.state.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.log.setReadOnly(True)
        self.button = QPushButton("Install uavseg into an environment of its own")
        self.button.clicked.connect(self.start)
        self.path.fileChanged.connect(self.save)
        self._task: InstallTask | None = None
        self._lay_out()
        self.refresh()

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.addRow("Program uavseg", self.path)
        form.addRow("Install from (name, wheel or folder)", self.requirement)
        layout = QVBoxLayout(self)
        layout.addLayout(form)
        for widget in (self.state, self.button, self.bar, self.log):
            layout.addWidget(widget)
        layout.addStretch(1)
        self.bar.hide()
        self.log.hide()

    def save(self) -> None:
        """Keep what was entered, and look for the program again."""
        QgsSettings().setValue(SETTING, self.path.filePath().strip())
        QgsSettings().setValue(REQUIREMENT_SETTING, self.requirement.text().strip())
        self.refresh()

    def refresh(self) -> None:
        """Say which program is used, or why there is none."""
        try:
            program: Path = ready_program()
            self.state.setText(f"uavseg {version_of(program)}: {program}")
        except ProgramError as error:
            self.state.setText(str(error))

    def start(self) -> None:
        """Install, or cancel what was begun."""
        if self._task is not None:
            self._task.cancel()
            return
        self.save()
        self._task = InstallTask()
        self._task.feedback.said.connect(self.log.appendPlainText)
        self._task.progressChanged.connect(lambda share: self.bar.setValue(int(share)))
        self._task.taskCompleted.connect(lambda: self.ended(""))
        self._task.taskTerminated.connect(self.failed)
        self.log.clear()
        for widget in (self.bar, self.log):
            widget.show()
        self.button.setText("Cancel")
        QgsApplication.taskManager().addTask(self._task)

    def failed(self) -> None:
        """Show why it failed."""
        self.ended(self._task.error if self._task is not None else "")

    def ended(self, error: str) -> None:
        """Show what came out."""
        self._task = None
        self.bar.hide()
        self.button.setText("Install uavseg into an environment of its own")
        self.refresh()
        if error:
            self.log.appendPlainText(error)
            self.state.setText(error)
            QgsApplication.messageLog().logMessage(error, TITLE, Qgis.MessageLevel.Warning)


class _Page(QgsOptionsPageWidget):
    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.panel = ProgramPanel(self)
        QVBoxLayout(self).addWidget(self.panel)

    def apply(self) -> None:
        self.panel.save()


class OptionsFactory(QgsOptionsWidgetFactory):
    """The page, as QGIS asks for it."""

    def __init__(self) -> None:
        super().__init__()
        self.setTitle(TITLE)

    def icon(self) -> QIcon:
        return QIcon(str(ICON))

    def createWidget(self, parent: QWidget) -> QgsOptionsPageWidget:
        return _Page(parent)
