"""The program is installed into an environment of its own, from a wheel that is made here."""

import zipfile
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("qgis.core")
pytest.importorskip("pytest_qgis")

from qgis.core import QgsProcessingFeedback, QgsSettings

from qgis_uavseg import install as installing, program
from qgis_uavseg.options_page import InstallTask, ProgramPanel
from qgis_uavseg.process import Cancelled

FILES = {
    "uavseg.py": "def run():\n    print('uavseg 1.0.7')\n",
    "uavseg-1.0.7.dist-info/METADATA": "Metadata-Version: 2.1\nName: uavseg\nVersion: 1.0.7\n",
    "uavseg-1.0.7.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    "uavseg-1.0.7.dist-info/entry_points.txt": "[console_scripts]\nuavseg = uavseg:run\n",
    "uavseg-1.0.7.dist-info/RECORD": "",
}


@pytest.fixture
def own(qgis_app: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the environment, and a wheel in the settings."""
    wheel = tmp_path / "uavseg-1.0.7-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in FILES.items():
            archive.writestr(name, text)
    folder = tmp_path / "profile" / "venv"
    folder.parent.mkdir()
    monkeypatch.setattr(installing, "own_folder", lambda: folder)
    monkeypatch.setattr(program, "own_folder", lambda: folder)
    monkeypatch.delenv("UAVSEG_PROGRAM", raising=False)
    QgsSettings().setValue(program.SETTING, "")
    QgsSettings().setValue(program.REQUIREMENT_SETTING, str(wheel))
    yield folder
    QgsSettings().remove("uavseg")


def test_the_program_is_installed_and_found(own: Path) -> None:
    made = installing.install(QgsProcessingFeedback(False))
    assert made == program.ready_program() == program.program_in(own)
    assert program.version_of(made) == "1.0.7"


def test_what_was_there_stays_where_the_installation_fails(own: Path) -> None:
    made = installing.install(QgsProcessingFeedback(False))
    QgsSettings().setValue(program.REQUIREMENT_SETTING, str(own.parent / "none.whl"))
    with pytest.raises(installing.InstallError, match=r"pip cannot install .*none\.whl: "):
        installing.install(QgsProcessingFeedback(False))
    assert program.version_of(made) == "1.0.7"
    assert [path.name for path in own.parent.iterdir()] == ["venv"]


def test_a_cancelled_installation_leaves_nothing(own: Path) -> None:
    feedback = QgsProcessingFeedback(False)
    feedback.cancel()
    with pytest.raises(Cancelled):
        installing.install(feedback)
    assert not list(own.parent.iterdir())


def test_without_a_python_the_error_says_what_to_do(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installing, "OLDEST", (9, 0))
    with pytest.raises(installing.InstallError, match=r"there is no Python 9\.0 or later \(.* is 3\."):
        installing.install(QgsProcessingFeedback(False))


def test_the_panel_says_what_to_type_and_the_task_installs(
    own: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    panel = ProgramPanel()
    assert "was not found; type: python3 -m venv" in panel.state.text()
    assert str(own) in panel.state.text()
    monkeypatch.undo()
    monkeypatch.setattr(installing, "own_folder", lambda: own)
    monkeypatch.setattr(program, "own_folder", lambda: own)
    monkeypatch.delenv("UAVSEG_PROGRAM", raising=False)
    task = InstallTask()
    assert task.run(), task.error
    panel.refresh()
    assert panel.state.text() == f"uavseg 1.0.7: {program.program_in(own)}"
