"""A mission over ticked regions: planned in the background, shown, and saved when it was seen."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qgis.core import QgsPointXY, QgsProcessingUtils
from qgis.PyQt.QtCore import QObject, pyqtSignal

from ..background import BackgroundRun
from ..process import Finished
from ..program import ProgramError, ready_program


@dataclass(frozen=True)
class MissionRequest:
    """What is planned.

    Parameters
    ----------
    regions : path
    ids : sequence of int, optional
        Regions that are flown over; None for all.
    options : sequence of (str, str)
        Options of `uavseg plan` and their values; empty values are left out.
    home : QgsPointXY, optional
        Longitude and latitude on WGS 84; without, the program chooses a place outside of the regions.
    zones : path, optional
        A file of keep-out zones.
    """

    regions: Path
    ids: tuple[int, ...] | None
    options: tuple[tuple[str, str], ...]
    home: QgsPointXY | None = None
    zones: Path | None = None

    def words(self, target: Path) -> list[str]:
        """The command line that writes the mission to a file; one that is there is replaced."""
        where = "auto" if self.home is None else f"{round(self.home.y(), 9)!r},{round(self.home.x(), 9)!r}"
        height = dict(self.options).get("--home-altitude", "")
        home = f"{where},{height}" if height and self.home is not None else where
        words = ["plan", f"--home={home}"]
        words += [f"{flag}={text}" for flag, text in self.options if text and flag != "--home-altitude"]
        words += [f"--avoid={self.zones}"] if self.zones else []
        words += [f"--ids={','.join(map(str, self.ids))}"] if self.ids is not None else []
        # Files of further flights, which the user was not asked about, are not replaced.
        words += ["--overwrite"] if target.exists() else []
        return [*words, f"--output={target}", "--json", "--footprints", "--", str(self.regions)]


@dataclass(frozen=True)
class Planned:
    """A mission that was planned: its request, the files of its flights, estimates and warnings."""

    request: MissionRequest
    files: tuple[Path, ...]
    found: dict[str, Any]


class MissionPlanner(QObject):
    """Plans in the background; what is saved is planned by the same words as what was shown.

    Signals
    -------
    shown : Planned
        A preview.
    saved : Planned
    failed : str
    """

    shown = pyqtSignal(object)
    saved = pyqtSignal(object)
    failed = pyqtSignal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._run = BackgroundRun(self)
        self._target, self._is_preview = Path(), True
        self._request = MissionRequest(Path(), None, ())
        self._run.succeeded.connect(self._planned)
        self._run.failed.connect(self.failed)

    @property
    def is_running(self) -> bool:
        """Whether the program is at work."""
        return self._run.is_running

    def preview(self, request: MissionRequest) -> None:
        """Plan a mission to look at."""
        self._start(request, Path(QgsProcessingUtils.generateTempFilename("mission.geojson")), True)

    def save(self, request: MissionRequest, target: Path) -> None:
        """Write a mission."""
        self._start(request, target, False)

    def drop_preview(self) -> None:
        """End a preview that is at work; what is being saved goes on."""
        if self._is_preview:
            self._run.cancel()

    def stop(self) -> None:
        """End what is at work, and wait for its end."""
        self._run.stop()

    def _start(self, request: MissionRequest, target: Path, is_preview: bool) -> None:
        self._request, self._target, self._is_preview = request, target, is_preview
        try:
            self._run.start(str(ready_program()), request.words(target))
        except ProgramError as error:
            self.failed.emit(str(error))

    def _planned(self, finished: Finished) -> None:
        found = json.loads(finished.output)
        files = tuple(self._target.parent / flight["file"] for flight in found["flights"])
        signal = self.shown if self._is_preview else self.saved
        signal.emit(Planned(self._request, files, found))


def summary(found: dict[str, Any]) -> str:
    """Estimates of a mission, a line for each flight, and what the program warns of, as HTML."""
    rows = []
    for number, flight in enumerate(found["flights"], 1):
        minutes, seconds = divmod(round(flight["duration_s"]), 60)
        parts = [f"{flight['distance_m'] / 1000:.2f} km", f"{minutes} min {seconds} s"]
        if flight["photographs"]:
            parts.append(f"{flight['photographs']} photographs")
        if flight.get("gsd_m"):
            parts.append(f"{100 * flight['gsd_m']:.2f} cm per pixel")
        if flight.get("photographed_m2"):
            parts.append(f"{flight['photographed_m2'] / 1e4:.2f} ha")
        if flight.get("energy_wh"):
            parts.append(f"{flight['energy_wh']:.0f} Wh")
        rows.append(f"<b>Flight {number}:</b> " + ", ".join(parts))
    return "<br>".join([*rows, *(f"⚠ {escaped(text)}" for text in found["warnings"])])


def escaped(text: str) -> str:
    """A text within HTML."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
