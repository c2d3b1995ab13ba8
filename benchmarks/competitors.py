"""The competitors: programs and scripts that extract polygons of the bright regions of a raster.

All have the same task: a GeoTIFF in, a GeoPackage out with polygons of the regions of v in 0.55..1, without
regions of fewer than 64 pixels. The whole process is measured, from start to end.
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
    """One run of a competitor: its input and its output."""

    scene: Scene
    raster: Path
    output: Path

    def sibling(self, name: str) -> str:
        """Path of an intermediate file in the folder of the output."""
        return str(self.output.with_name(name))


@dataclass(frozen=True, slots=True)
class Competitor:
    """A competitor.

    Parameters
    ----------
    name : str
    title : str
        Title in the table.
    commands : callable
        The commands of a job, to be run one after the other.
    requires : tuple of str
        Python modules that it needs.
    unavailable : callable
        Any other reason why it cannot run, or None.
    environment : mapping
        Environment variables of its processes; if empty, the current ones with the project on the path.
    max_side : int, optional
        Side of the largest scene that it is run on.
    max_bands : int
        Of a scene that it is run on.
    """

    name: str
    title: str
    commands: Callable[[Job], list[Command]]
    requires: tuple[str, ...] = ()
    unavailable: Callable[[], str | None] = lambda: None
    environment: Mapping[str, str] = field(default_factory=dict)
    max_side: int | None = None
    max_bands: int = 3

    def skip_reason(self, scene: Scene) -> str | None:
        """Why it is skipped for a scene, in a few words, or None."""
        if self.max_side is not None and scene.side > self.max_side:
            return f"only run up to {self.max_side}²"
        if scene.bands > self.max_bands:
            return f"only run on {self.max_bands} band"
        missing = [module for module in self.requires if importlib.util.find_spec(module) is None]
        if missing:
            return f"Python has no {', '.join(missing)}"
        return self.unavailable()

    def child_environment(self) -> dict[str, str]:
        """Environment variables of its processes."""
        return dict(self.environment) or with_project(os.environ)


def with_project(child_environment: Mapping[str, str]) -> dict[str, str]:
    """Environment variables with which the uavseg of this checkout is found first, from any folder."""
    before = child_environment.get("PYTHONPATH")
    return {**child_environment, "PYTHONPATH": os.pathsep.join([str(PROJECT), *([before] if before else [])])}


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
    """A competitor that is a script in `peers`, called with RASTER OUTPUT."""
    return lambda job: [[sys.executable, str(PEERS / f"{name}.py"), str(job.raster), str(job.output)]]


# GDAL's programs run on the system's Python, which must not find the packages of this environment.
_SYSTEM = {"PATH": "/usr/local/bin:/usr/bin:/bin", "LC_ALL": "C.UTF-8"}
_GDAL = ("gdal_calc.py", "gdal_sieve.py", "gdal_polygonize.py")


def _gdal(job: Job) -> list[Command]:
    mask, sieved = job.sibling("mask.tif"), job.sibling("sieved.tif")
    bands = [text for k, name in enumerate("ABC"[: job.scene.bands]) for text in _band(job, name, k + 1)]
    intensity = LUMINANCE if job.scene.bands == 3 else "A"
    inside = f"{intensity} >= {LOW * job.scene.white:.12g}"
    calc, sieve, polygonize = (str(_system(program)) for program in _GDAL)
    return [
        [calc, "--quiet", *bands, f"--calc={inside}", "--type=Byte", "--co=TILED=YES", f"--outfile={mask}"],
        [sieve, "-q", "-st", str(MIN_PIXELS), "-4", mask, sieved],
        [polygonize, "-q", "-mask", sieved, "-f", "GPKG", sieved, str(job.output)],
    ]


def _pipeline(job: Job) -> list[Command]:
    bounds = f"{LOW * job.scene.white:.12g}", f"{job.scene.white:.12g}"
    script = [sys.executable, str(PEERS / "gdal_pipeline.py")]
    return [[*script, str(job.raster), str(job.output), *bounds, str(MIN_PIXELS)]]


def _pipeline_unavailable() -> str | None:
    probe = (
        "import pyogrio; raise SystemExit(pyogrio.__gdal_version__ < (3, 12))"  # not here: it takes memory
    )
    too_old = subprocess.run([sys.executable, "-c", probe], capture_output=True).returncode
    return "pyogrio brings no GDAL 3.12" if too_old else None


def _band(job: Job, name: str, number: int) -> list[str]:
    return [f"-{name}", str(job.raster), f"--{name}_band={number}"]


def _system(program: str) -> str | None:
    return shutil.which(program, path=_SYSTEM["PATH"])


def _gdal_unavailable() -> str | None:
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
        unavailable=_gdal_unavailable,
        environment=_SYSTEM,
    ),
    Competitor(
        "pipeline",
        "GDAL 3.12 in one process: gdal pipeline (reclassify, sieve, polygonize)",
        _pipeline,
        ("pyogrio",),
        unavailable=_pipeline_unavailable,
        max_bands=1,
    ),
    Competitor(
        "slic",
        "scikit-image SLIC, segments selected by their mean",
        _script("slic"),
        ("skimage", "rasterio", "geopandas"),
        max_side=2048,
    ),
)


def select_competitors(names: list[str] | None) -> list[Competitor]:
    """The competitors with these names, or all.

    Raises
    ------
    ValueError
        If a name is unknown.
    """
    known = {competitor.name: competitor for competitor in COMPETITORS}
    for name in names or []:
        if name not in known:
            raise ValueError(f"expected a competitor out of {', '.join(known)}, got {name!r}")
    return list(COMPETITORS) if names is None else [known[name] for name in names]
