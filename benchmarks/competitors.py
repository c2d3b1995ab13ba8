"""What is run against what: each competitor makes polygons of the bright regions of a raster.

The task is the same for all: a GeoTIFF in, a GeoPackage out with polygons of the regions of v in 0.55..1,
pieces under 64 pixels dropped, everything from the start of the process to its end.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.scenes import PROJECT, Scene

LOW = 0.55
MIN_PIXELS = 64
LUMINANCE = "0.2126*A.astype(float) + 0.7152*B + 0.0722*C"
PEERS = Path(__file__).resolve().parent / "peers"

Command = list[str]


@dataclass(frozen=True, slots=True)
class Job:
    """One run of a competitor: what it reads and where it writes."""

    scene: Scene
    raster: Path
    output: Path

    def beside(self, name: str) -> str:
        """A file of its own beside the output."""
        return str(self.output.with_name(name))


@dataclass(frozen=True, slots=True)
class Competitor:
    """Who takes part.

    Parameters
    ----------
    name : str
    title : str
        For the table.
    commands : callable
        The commands of a job, to be run one after the other.
    wants : tuple of str
        Modules of this Python that it needs.
    absent : callable
        Why it cannot run for another reason, or None.
    environment : mapping
        What its processes see instead of our environment; empty for ours with the project on the path.
    largest : int, optional
        Side of the largest scene that it is run on.
    """

    name: str
    title: str
    commands: Callable[[Job], list[Command]]
    wants: tuple[str, ...] = ()
    absent: Callable[[], str | None] = lambda: None
    environment: Mapping[str, str] = field(default_factory=dict)
    largest: int | None = None

    def why_not(self, scene: Scene) -> str | None:
        """Why it does not take part, in a few words, or None if it does."""
        if self.largest is not None and scene.side > self.largest:
            return f"only run up to {self.largest}²"
        missing = [module for module in self.wants if importlib.util.find_spec(module) is None]
        if missing:
            return f"Python has no {', '.join(missing)}"
        return self.absent()

    def variables(self) -> dict[str, str]:
        """The environment of its processes."""
        return dict(self.environment) or with_project(os.environ)


def with_project(variables: Mapping[str, str]) -> dict[str, str]:
    """An environment in which this checkout's uavseg is found first, from any folder."""
    before = variables.get("PYTHONPATH")
    return {**variables, "PYTHONPATH": os.pathsep.join([str(PROJECT), *([before] if before else [])])}


def _uavseg(job: Job) -> list[Command]:
    command = [sys.executable, "-m", "uavseg", "extract", str(job.raster), "--range", f"{LOW},1"]
    return [
        [
            *command,
            "--stretch",
            f"0,{job.scene.white:g}",
            "--min-area",
            f"{MIN_PIXELS}px",
            "-o",
            str(job.output),
        ]
    ]


def _script(name: str) -> Callable[[Job], list[Command]]:
    """A peer that is a script of this folder: RASTER OUTPUT."""
    return lambda job: [[sys.executable, str(PEERS / f"{name}.py"), str(job.raster), str(job.output)]]


# GDAL's own programs belong to the system's Python, which must not see ours.
_SYSTEM = {"PATH": "/usr/local/bin:/usr/bin:/bin", "LC_ALL": "C.UTF-8"}
_GDAL = ("gdal_calc.py", "gdal_sieve.py", "gdal_polygonize.py")


def _gdal(job: Job) -> list[Command]:
    mask, sieved = job.beside("mask.tif"), job.beside("sieved.tif")
    bands = [text for k, name in enumerate("ABC"[: job.scene.bands]) for text in _band(job, name, k + 1)]
    intensity = LUMINANCE if job.scene.bands == 3 else "A"
    inside = f"{intensity} >= {LOW * job.scene.white:.12g}"
    calc, sieve, polygonize = (str(_system(program)) for program in _GDAL)
    return [
        [calc, "--quiet", *bands, f"--calc={inside}", "--type=Byte", "--co=TILED=YES", f"--outfile={mask}"],
        [sieve, "-q", "-st", str(MIN_PIXELS), "-4", mask, sieved],
        [polygonize, "-q", "-mask", sieved, "-f", "GPKG", sieved, str(job.output)],
    ]


def _band(job: Job, name: str, number: int) -> list[str]:
    return [f"-{name}", str(job.raster), f"--{name}_band={number}"]


def _system(program: str) -> str | None:
    return shutil.which(program, path=_SYSTEM["PATH"])


def _without_gdal() -> str | None:
    missing = [program for program in _GDAL if _system(program) is None]
    if missing:
        return f"the system has no {', '.join(missing)} (apt: gdal-bin)"
    probe = ["python3", "-c", "from osgeo import gdal_array"]
    if subprocess.run(probe, env=_SYSTEM, capture_output=True).returncode:
        return "the system's Python has no osgeo.gdal_array (apt: python3-gdal)"
    return None


COMPETITORS = (
    Competitor("uavseg", "**uavseg extract**", _uavseg),
    Competitor(
        "opencv",
        "careful script: OpenCV, rasterio.features.shapes, pyogrio",
        _script("opencv"),
        ("cv2", "rasterio", "shapely", "pyogrio"),
    ),
    Competitor(
        "usual",
        "usual script: scipy, rasterio.features.shapes, geopandas",
        _script("usual"),
        ("scipy", "rasterio", "geopandas"),
    ),
    Competitor(
        "gdal",
        "GDAL programs: gdal_calc, gdal_sieve, gdal_polygonize",
        _gdal,
        absent=_without_gdal,
        environment=_SYSTEM,
    ),
    Competitor(
        "slic",
        "scikit-image SLIC, segments chosen by their mean",
        _script("slic"),
        ("skimage", "rasterio", "geopandas"),
        largest=2048,
    ),
)


def chosen(names: list[str] | None) -> list[Competitor]:
    """The competitors of these names, or all.

    Raises
    ------
    ValueError
        If there is none of a name.
    """
    known = {competitor.name: competitor for competitor in COMPETITORS}
    for name in names or []:
        if name not in known:
            raise ValueError(f"a competitor is one of {', '.join(known)}, not {name!r}")
    return list(COMPETITORS) if names is None else [known[name] for name in names]
