"""The rasters of the benchmarks and their files."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
FOLDER = PROJECT / "benchmarks" / "data"
KINDS = {
    "grey8": ("uint8", 1),
    "rgb8": ("uint8", 3),
    "grey16": ("uint16", 1),
    "float32": ("float32", 1),
}
WHITE = {"uint8": 255.0, "uint16": 65535.0, "float32": 1.0}


@dataclass(frozen=True, slots=True)
class Scene:
    """A square synthetic raster.

    Parameters
    ----------
    side : int
        Number of rows, and of columns.
    kind : str
        Pixel type, one of `KINDS`.

    Raises
    ------
    ValueError
        If the side is not positive or the kind is unknown.
    """

    side: int
    kind: str = "grey8"

    def __post_init__(self) -> None:
        if self.side < 1:
            raise ValueError(f"expected a scene with at least one row, got {self.side}")
        if self.kind not in KINDS:
            raise ValueError(
                f"expected the pixel type of a scene out of {', '.join(KINDS)}, got {self.kind!r}"
            )

    @property
    def dtype(self) -> str:
        """Data type of a band."""
        return KINDS[self.kind][0]

    @property
    def bands(self) -> int:
        """1, or 3 for red, green and blue."""
        return KINDS[self.kind][1]

    @property
    def bytes_per_pixel(self) -> int:
        """Decoded size of a pixel, all bands."""
        return self.bands * {"uint8": 1, "uint16": 2, "float32": 4}[self.dtype]

    @property
    def white(self) -> float:
        """The value of v = 1."""
        return WHITE[self.dtype]

    @property
    def title(self) -> str:
        """Title in the tables."""
        return f"{self.side}²" if self.kind == "grey8" else f"{self.side}² {self.kind}"


def ensure_raster(scene: Scene, folder: Path = FOLDER) -> Path:
    """The file of a scene; if it is missing, a child process creates it."""
    path = folder / f"{scene.kind}-{scene.side}.tif"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "benchmarks.data", str(scene.side), scene.kind, str(path)]
        subprocess.run(command, cwd=PROJECT, check=True)
    return path
