"""What intensity is: a band, a spectral index, or a formula of bands."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from qgis.core import QgsRasterLayer
from qgis.gui import QgsRasterBandComboBox
from qgis.PyQt.QtCore import pyqtSignal
from qgis.PyQt.QtWidgets import QComboBox, QFormLayout, QLineEdit, QWidget

from ..reading import INDICES

BAND, INDEX, FORMULA = "a band", "an index", "a formula"
LABELS = {"--band": "Band", "--index": "Index", "--expr": "Formula", "--band-names": "Band names"}


@dataclass(frozen=True)
class Intensity:
    """What the program reads as intensity; without anything, what it takes by itself.

    Parameters
    ----------
    band : int
        0 for what the program takes by itself.
    index : str
        In place of a band: a spectral index.
    formula : str
        In place of both: band arithmetic.
    names : str
        Names of the bands, for an index or a formula.
    """

    band: int = 0
    index: str = ""
    formula: str = ""
    names: str = ""

    def words(self) -> list[str]:
        """The options of the command line."""
        chosen = (
            ("--band", str(self.band or "")),
            ("--index", self.index),
            ("--expr", self.formula),
            ("--band-names", self.names),
        )
        return [f"{flag}={text}" for flag, text in chosen if text]

    @property
    def title(self) -> str:
        """For the name of a layer; empty for a band."""
        return self.index or self.formula

    @property
    def key(self) -> str:
        """A part of a file name that no other choice has; empty for what the program takes by itself."""
        if self.band:
            return f"band{self.band}"
        if not self.formula and not self.names:
            return self.index
        digest = hashlib.sha256("\0".join((self.index, self.formula, self.names)).encode()).hexdigest()
        return f"{self.index or 'formula'}-{digest[:12]}"


class IntensityBox(QWidget):
    """Chooses an `Intensity`.

    Signals
    -------
    changed
    """

    changed = pyqtSignal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.kinds, self.bands, self.indices = QComboBox(), QgsRasterBandComboBox(), QComboBox()
        self.formula, self.names = QLineEdit(), QLineEdit()
        self.form = QFormLayout(self)
        self.form.setContentsMargins(0, 0, 0, 0)
        self.form.setVerticalSpacing(3)  # rows that are hidden keep theirs
        self.kinds.addItems((BAND, INDEX, FORMULA))
        self.indices.addItems(INDICES)
        self.bands.setShowNotSetOption(True, "as the program chooses")
        self.bands.setToolTip("Without a choice: the only band, or the luminance of red, green and blue")
        self.formula.setPlaceholderText("(nir - red) / (nir + red)")
        self.formula.setToolTip("Arithmetic of bands by name or number (b1, b2); Enter takes it")
        self.names.setPlaceholderText("as in the file")
        self.names.setToolTip("Names of the bands: red,green,blue,nir, or some: nir=4; Enter takes them")
        self._rows = (
            ("Intensity", self.kinds, (BAND, INDEX, FORMULA)),
            (LABELS["--band"], self.bands, (BAND,)),
            (LABELS["--index"], self.indices, (INDEX,)),
            (LABELS["--expr"], self.formula, (FORMULA,)),
            (LABELS["--band-names"], self.names, (INDEX, FORMULA)),
        )
        for label, widget, _ in self._rows:
            self.form.addRow(label, widget)
            widget.setAccessibleName(label)
        self._taken = (Intensity(), "")
        self._show_rows()
        self.kinds.currentIndexChanged.connect(self._kind_changed)
        self.bands.bandChanged.connect(lambda band: self._take())
        self.indices.currentIndexChanged.connect(lambda index: self._take())
        for line in (self.formula, self.names):
            line.editingFinished.connect(self._take)

    def set_layer(self, layer: QgsRasterLayer | None) -> None:
        """Offer the bands of a raster; no signal follows."""
        self.blockSignals(True)
        self.bands.setLayer(layer)
        self.bands.setBand(-1)
        self.blockSignals(False)
        self._taken = (self.value(), self.missing)

    def value(self) -> Intensity:
        """What is chosen."""
        kind = self.kinds.currentText()
        if kind == BAND:
            return Intensity(max(self.bands.currentBand(), 0))
        names = self.names.text().strip()
        if kind == INDEX:
            return Intensity(index=self.indices.currentText(), names=names)
        return Intensity(formula=self.formula.text().strip(), names=names)

    @property
    def missing(self) -> str:
        """What has to be typed first; empty if nothing."""
        is_empty = self.kinds.currentText() == FORMULA and not self.formula.text().strip()
        return f"Type a formula of bands, such as {self.formula.placeholderText()}" if is_empty else ""

    def _kind_changed(self) -> None:
        self._show_rows()
        self._take()

    def _show_rows(self) -> None:
        for _, widget, kinds in self._rows:
            is_shown = self.kinds.currentText() in kinds
            widget.setVisible(is_shown)
            self.form.labelForField(widget).setVisible(is_shown)

    def _take(self) -> None:
        """A line ends its editing when it loses the focus, too: then nothing has changed."""
        now = (self.value(), self.missing)
        if now != self._taken:
            self._taken = now
            self.changed.emit()
