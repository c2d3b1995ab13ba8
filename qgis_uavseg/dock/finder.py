"""Regions of a raster: its block map, made once; exact regions of a range; regions like a sample."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from qgis.core import QgsPointXY, QgsProcessingException, QgsProcessingUtils, QgsRasterLayer
from qgis.PyQt.QtCore import QObject, pyqtSignal

from ..background import BackgroundRun
from ..options import plain
from ..process import Finished
from ..program import ProgramError, ready_program
from ..targets import raster_file
from .block_means import BlockMeans, BlockMeansError
from .block_store import block_file, is_fresh, make_room
from .intensity import Intensity

TITLE = "Raster"
BY_ITSELF = Intensity()
DIVIDING = "The block map is made, once for each raster; then the slider answers"


@dataclass(frozen=True)
class Found:
    """Regions that the program found: the file, and what they are."""

    path: Path
    title: str
    said: tuple[str, ...]


class _Warnings:
    """Warnings about a layer, kept."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def pushWarning(self, text: str) -> None:
        self.texts.append(text)


class RegionFinder(QObject):
    """What the dock asks the program for, one answer at a time.

    Signals
    -------
    said : str
        What is done now, or a warning.
    failed : str
    progressed : int
        Per cent; 100 when nothing is at work.
    means_ready : BlockMeans
    regions_ready : Found
    """

    said = pyqtSignal(str)
    failed = pyqtSignal(str)
    progressed = pyqtSignal(int)
    means_ready = pyqtSignal(object)
    regions_ready = pyqtSignal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.raster: Path | None = None
        self.blocks: Path | None = None
        self.means: BlockMeans | None = None
        self.intensity = BY_ITSELF
        self._title, self._target = "", Path()
        self._dividing, self._finding = BackgroundRun(self), BackgroundRun(self)
        for run, take in ((self._dividing, self._divided), (self._finding, self._found)):
            run.progressed.connect(self.progressed)
            run.succeeded.connect(take)
            run.failed.connect(self._failed)

    @property
    def is_running(self) -> bool:
        """Whether the program is at work."""
        return self._dividing.is_running or self._finding.is_running

    def set_raster(self, layer: QgsRasterLayer | None, intensity: Intensity = BY_ITSELF) -> None:
        """Take another raster; its block map is read, or made in the background.

        Parameters
        ----------
        layer : QgsRasterLayer, optional
        intensity : Intensity
            What the program reads of it.
        """
        self.cancel()
        self.intensity = intensity
        self.raster = self.blocks = self.means = None
        if layer is None:
            return
        warnings = _Warnings()
        try:
            self.raster = Path(raster_file(layer, TITLE, warnings))
        except QgsProcessingException as error:
            self.failed.emit(str(error))
            return
        self.blocks = block_file(self.raster, intensity.key)
        if is_fresh(self.blocks, self.raster):
            self._read_means(self.blocks)
        else:
            self._divide(self.raster, self.blocks)
        if warnings.texts:  # after what is done now, so that it stays
            self.said.emit("; ".join(warnings.texts))

    def find(self, low: float, high: float) -> None:
        """Find the exact regions of a range in the background; an earlier search is ended."""
        if self.means is None or self.blocks is None or self.raster is None:
            return
        self._title = self._titled(f"v {low:g} to {high:g}")
        words = ["extract", f"--range={plain(low)},{plain(high)}", f"--allow-path={self.raster.parent}"]
        self._search(words, self.blocks)

    def match(self, center: QgsPointXY, radius: float) -> None:
        """Find regions like a disc in the background; an earlier search is ended.

        Parameters
        ----------
        center : QgsPointXY
            In the CRS of the raster.
        radius : float
            In metres where the raster's CRS is in degrees, else in its unit.
        """
        if self.raster is None:
            return
        self._title = self._titled("like the sample")
        like = f"--like={plain(center.x())},{plain(center.y())},{plain(radius)}"
        self._search(["match", like, *self.intensity.words()], self.raster)

    def cancel_search(self) -> None:
        """End the search that is at work; the block map goes on."""
        self._finding.cancel()

    def cancel(self) -> None:
        """End what is at work."""
        self._dividing.cancel()
        self._finding.cancel()
        self.progressed.emit(100)

    def stop(self) -> None:
        """End what is at work, and wait for its end."""
        self._dividing.stop()
        self._finding.stop()

    def _titled(self, text: str) -> str:
        return f"{self.intensity.title}, {text}" if self.intensity.title else text

    def _divide(self, raster: Path, blocks: Path) -> None:
        if blocks.parent != raster.parent:
            make_room(blocks.parent)
        self.said.emit(DIVIDING)
        words = ["divide", *self.intensity.words(), f"--output={blocks}"]
        self._run(self._dividing, [*words, "--overwrite", "--progress=plain", "--", str(raster)])

    def _search(self, words: list[str], source: Path) -> None:
        self._target = Path(QgsProcessingUtils.generateTempFilename("regions.gpkg"))
        self.said.emit("Regions are found to the pixel")
        self._run(self._finding, [*words, f"--output={self._target}", "--progress=plain", "--", str(source)])

    def _run(self, run: BackgroundRun, words: list[str]) -> None:
        try:
            program = ready_program()
        except ProgramError as error:
            self._failed(str(error))
            return
        self.progressed.emit(0)
        run.start(str(program), words)

    def _divided(self, finished: Finished) -> None:
        self.progressed.emit(100)
        if self.blocks is not None:
            self._read_means(self.blocks)

    def _read_means(self, blocks: Path) -> None:
        try:
            self.means = BlockMeans(blocks)
        except BlockMeansError as error:
            self._failed(str(error))
            return
        self.means_ready.emit(self.means)

    def _found(self, finished: Finished) -> None:
        self.progressed.emit(100)
        self.regions_ready.emit(Found(self._target, self._title, finished.lines))

    def _failed(self, text: str) -> None:
        self.progressed.emit(100)
        self.failed.emit(text)
