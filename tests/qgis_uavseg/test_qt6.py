"""The plugin under PyQt6, as of QGIS 4, with stand-ins for `qgis.core` and `qgis.gui`."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock, patch

import pytest

QtCore = pytest.importorskip("PyQt6.QtCore", reason="PyQt6 is not installed")
from PyQt6 import QtGui, QtWidgets  # noqa: E402


class _Constants(type):
    """Classes of which every constant is there, whatever its name."""

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return MagicMock(name=name)


class _Anything(MagicMock, metaclass=_Constants):
    """A class of QGIS: takes any arguments, and has every method."""

    def __new__(cls, *_: Any, **__: Any) -> Any:
        return super().__new__(cls)

    def __init__(self, *_: Any, **__: Any) -> None:
        super().__init__()

    def _get_child_mock(self, **words: Any) -> MagicMock:
        return MagicMock(**words)


class MapTool(QtCore.QObject):
    """As `QgsMapTool`: an object of Qt, so its signals are real."""

    def __init__(self, canvas: Any = None) -> None:
        super().__init__()

    def __getattr__(self, name: str) -> Any:
        return MagicMock(name=name)


class Choice(QtWidgets.QComboBox):
    """As the boxes of QGIS in which a file, a layer or a band is chosen; nothing is."""

    fileChanged, layerChanged = QtCore.pyqtSignal(str), QtCore.pyqtSignal(object)  # noqa: N815 - QGIS's names
    bandChanged = QtCore.pyqtSignal(int)  # noqa: N815

    def __init__(self) -> None:
        super().__init__(editable=True)

    def __getattr__(self, name: str) -> Any:
        return (lambda: None) if name.startswith("current") else MagicMock(name=name)


class Dock(QtWidgets.QDockWidget):
    """As `QgsDockWidget`."""

    closed, opened = QtCore.pyqtSignal(), QtCore.pyqtSignal()


WIDGETS = {
    "QgsDockWidget": Dock,
    "QgsOptionsPageWidget": QtWidgets.QWidget,
    "QgsFileWidget": Choice,
    "QgsMapLayerComboBox": Choice,
    "QgsRasterBandComboBox": Choice,
    "QgsMapTool": MapTool,
}


class _Module(ModuleType):
    """A module of QGIS with every class."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        made = WIDGETS.get(name) or _Constants(name, (_Anything,), {})
        setattr(self, name, made)
        return made


@pytest.fixture(scope="session")
def application() -> Iterator[Any]:
    """PyQt6 in the place of `qgis.PyQt`, and an application without a screen."""
    modules = {name: ModuleType(name) for name in ("qgis", "qgis.PyQt")}
    modules |= {name: _Module(name) for name in ("qgis.core", "qgis.gui", "qgis.utils", "processing")}
    modules |= {"qgis.PyQt.QtCore": QtCore, "qgis.PyQt.QtGui": QtGui, "qgis.PyQt.QtWidgets": QtWidgets}
    with patch.dict(sys.modules, modules):
        yield QtWidgets.QApplication(["test", "-platform", "offscreen"])


pytestmark = pytest.mark.usefixtures("application")
ROOT = Path(__file__).resolve().parents[2]
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts) for path in (ROOT / "qgis_uavseg").rglob("*.py")
)


def test_the_modules_are_those_of_the_plugin() -> None:
    assert {"qgis_uavseg.legs", "qgis_uavseg.dock.regions_dock", "qgis_uavseg.algorithms.match"} <= {*MODULES}


@pytest.mark.parametrize("name", MODULES)
def test_a_module_is_imported(name: str) -> None:
    importlib.import_module(name)


def test_algorithms_define_their_parameters() -> None:
    from qgis_uavseg.provider import UavsegProvider

    made: list[Any] = []
    provider = UavsegProvider()
    provider.addAlgorithm = made.append
    provider.loadAlgorithms()
    for algorithm in made:
        algorithm.addParameter = MagicMock()
        algorithm.initAlgorithm({})
        assert algorithm.addParameter.call_count >= 2, algorithm
    assert len(made) > 10


def test_the_desktop_gets_its_dock_and_its_menu_and_loses_them() -> None:
    from qgis_uavseg.plugin import UavsegPlugin

    shown = MagicMock()
    shown.mainWindow.return_value = None
    plugin = UavsegPlugin(shown)
    plugin.initGui()
    assert plugin.dock.windowTitle() and plugin.dock.widget() is not None
    actions = [call.args[1] for call in shown.addPluginToMenu.call_args_list]
    assert len(actions) == 2 and all(action.text() for action in actions)
    plugin.unload()
    assert plugin.dock is None and shown.removePluginMenu.call_count == 2


def test_the_page_of_the_program_is_made() -> None:
    from qgis_uavseg.options_page import ProgramPanel

    panel = ProgramPanel(None)
    assert panel.layout().count() > 1
