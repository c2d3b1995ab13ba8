"""Diagnosis of an installation: versions, kernels, threads and what is connected; warm-up."""

import importlib
import importlib.metadata
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from typing import Any

from uavseg import _version
from uavseg._jit import object_cache, shipped, warming
from uavseg.arguments import checked
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, ParameterError
from uavseg.execution.executors import Progress, usable_cores
from uavseg.flight.link.transport import serial_ports
from uavseg.plain_text import cause_of, one_line

_NEEDED = (
    *("numpy", "rasterio", "pyogrio", "pyproj", "shapely", "geopandas", "pandas", "matplotlib"),
    *("pymavlink", "click", "yaml", "skimage"),
)
_FOR_DEVELOPERS = ("test", "dev", "docs", "bench")  # extras
_DISTRIBUTIONS = {"yaml": "PyYAML", "serial": "pyserial", "skimage": "scikit-image"}
_NAMED = (
    *("PROJ_LIB", "PROJ_DATA", "GDAL_DATA", "GDAL_DRIVER_PATH"),
    *("PYTHONHOME", "PYTHONPATH", "LD_LIBRARY_PATH", "UAVSEG_CACHE"),
)
_EPSG = 32618  # any code that the database of PROJ has
_LIBRARIES = (
    *("rasterio", "pyogrio", "geopandas", "pyproj", "shapely", "yaml"),
    *("matplotlib.font_manager", "pymavlink.mavutil"),  # the first makes its list of fonts, once for a user
)
_PROGRAMS = ("qgis_process.bin", "qgis_process", "qgis_process-qgis.bat", "qgis_process-qgis-ltr.bat")
_KEPT = ("PATH", "LANG", "SYSTEMROOT")  # other variables may name libraries of Python's
_FOLDERS = ("HOME", "XDG_RUNTIME_DIR", "QGIS_CUSTOM_CONFIG_PATH", "TEMP", "TMP")  # that QGIS may write to
_TIMEOUT_S = 20.0
_NAME_ONE = "name one that only you can write to in UAVSEG_CACHE"


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """State of an installation: facts by topic, and problems, each with what to do; empty if all is well."""

    facts: dict[str, str]
    problems: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the same for JSON."""
        return {"facts": dict(self.facts), "problems": list(self.problems)}

    def __str__(self) -> str:
        width = max(len(topic) for topic in self.facts)
        lines = [f"{topic:<{width}}  {fact}" for topic, fact in self.facts.items()]
        lines += [f"problem: {problem}" for problem in self.problems] or ["no problems found"]
        return "\n".join(lines)


def doctor() -> Diagnosis:
    """Diagnose this installation, in a form that fits an issue report.

    Versions of Python, GDAL, PROJ and the libraries; whether they load and PROJ finds its database; state of
    the compiled kernels; threads; whether QGIS and a serial port for a vehicle are there. Nothing is compiled
    or installed, and nothing is sent to a vehicle.

    Examples
    --------
    >>> import uavseg
    >>> found = uavseg.doctor()
    >>> found.facts["uavseg"] == uavseg.__version__
    True
    """
    facts = {
        "uavseg": _version.__version__,
        "Python": f"{platform.python_implementation()} {platform.python_version()}",
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }
    problems: list[str] = []
    for check in (_libraries, _projections, _kernels, _environment, _neighbours):
        found, wrong = check()
        facts |= found
        problems += wrong
    return Diagnosis({topic: one_line(fact) for topic, fact in facts.items()}, tuple(map(one_line, problems)))


Findings = tuple[dict[str, str], list[str]]


def _libraries() -> Findings:
    """Return versions of libraries; those that are needed are loaded."""
    facts, problems = {}, []
    for name in _NEEDED:
        facts[name], failure = _loaded(name)
        if failure:
            remedy = "install it again: pip install uavseg"
            if "libexpat" in failure:  # wheels of rasterio bring all libraries but this one
                remedy = "install it from the system: apt install libexpat1"
            problems.append(f"{name} cannot be loaded ({failure}); {remedy}")
    return facts | _extras(), problems


def _extras() -> dict[str, str]:
    """Return versions of the libraries of each extra, or which are missing and how they are installed."""
    try:
        required = "\n".join(importlib.metadata.requires("uavseg") or ())
    except importlib.metadata.PackageNotFoundError:
        return {"extras": "unknown: this is a copy of the source that is not installed"}
    names: dict[str, list[str]] = {}
    for name, extra in re.findall(r"""^([\w.-]+)\b.*extra == ["'](\w+)["']""", required, re.MULTILINE):
        names.setdefault(extra, []).append(name)
    facts = {}
    for extra in sorted(names.keys() - set(_FOR_DEVELOPERS)):
        missing = [name for name in names[extra] if not _version_of(name)]
        there = ", ".join(f"{name} {_version_of(name)}" for name in names[extra])
        hint = f'{" and ".join(missing)} not installed: pip install "uavseg[{extra}]"'
        facts[f"extra {extra}"] = hint if missing else there
    return facts


def _loaded(name: str) -> tuple[str, str]:
    """Return the version of a library with those of the libraries inside it, and why it cannot be loaded."""
    version = _version_of(name)
    try:
        module = importlib.import_module(name)
        inside = [f"{label} {getattr(module, one)}" for label, one in _INSIDE.get(name, {}).items()]
    except Exception as error:  # a damaged library raises anything, and that is what is looked for
        return version or "missing", cause_of(error)
    return f"{version or 'unknown version'}{', with ' if inside else ''}{', '.join(inside)}", ""


_INSIDE = {
    "rasterio": {"GDAL": "__gdal_version__", "PROJ": "__proj_version__", "GEOS": "__geos_version__"},
    "pyogrio": {"GDAL": "__gdal_version_string__"},
    "pyproj": {"PROJ": "proj_version_str"},
    "shapely": {"GEOS": "geos_version_string"},
}


def _version_of(name: str) -> str:
    """Return the version of a distribution by the name of its module; empty where it is not installed."""
    try:
        return importlib.metadata.version(_DISTRIBUTIONS.get(name, name))
    except importlib.metadata.PackageNotFoundError:
        return ""


def _projections() -> Findings:
    """Return whether both libraries that bring PROJ find a database that they can read."""
    problems = []
    for name in ("rasterio", "pyproj"):
        try:
            importlib.import_module(f"{name}.crs").CRS.from_epsg(_EPSG)
        except Exception as error:  # each library has its own errors, and import errors come first
            named = [variable for variable in ("PROJ_LIB", "PROJ_DATA") if variable in os.environ]
            what = f"install {name} again"
            if named:
                what = f"unset {' and '.join(named)}, which may name the data of another PROJ"
            problems.append(f"{name} cannot look up EPSG:{_EPSG} ({cause_of(error)}); {what}")
    return {"EPSG database": "not readable" if problems else "found"}, problems


def _kernels() -> Findings:
    """Return where the machine code of the kernels comes from."""
    try:
        kernels = warming.all_kernels()
    except ImportError as error:
        return {"kernels": "unknown"}, [f"the kernels cannot be listed ({cause_of(error)})"]
    found = warming.states(kernels)
    level = shipped.levels_here()[0] if shipped.runs_here() else "no kernels are shipped for this platform"
    text = f"{len(kernels)}: {found['shipped']} shipped, {found['kept']} compiled before"
    facts = {"kernels": f"{text}, {found['missing']} not compiled yet", "processor level": level}
    if not found["kept"] and not found["missing"]:
        return facts | {"kernel cache": "not needed"}, []
    kept = not object_cache.is_temporary(object_cache.cache_folder())
    facts["kernel cache"] = "writable" if kept else "not writable"
    problems = []
    if found["missing"] and not _version_of("numba"):
        problems.append(
            f"{found['missing']} kernels have to be compiled and numba is not installed; "
            'install it: pip install "uavseg[compile]"'
        )
    if not kept:
        problems.append(f"no folder can keep compiled kernels; {_NAME_ONE}")
    return facts, problems


def _environment() -> Findings:
    """List processors, and variables that change what is loaded, by name: their values are paths of users."""
    cores = usable_cores()
    said = [name for name in _NAMED if os.environ.get(name)]
    choice = os.environ.get("UAVSEG_JIT")
    said += [f"UAVSEG_JIT={choice}"] if choice else []
    threads = f"{cores} of {os.cpu_count() or cores} processors"
    return {"threads": threads, "variables set": ", ".join(said) or "none"}, []


def _neighbours() -> Findings:
    """Look for QGIS and serial ports."""
    ports = serial_ports()
    facts = {"QGIS": find_qgis() or "not found", "serial ports": ", ".join(map(str, ports)) or "none"}
    denied = [port.device for port in ports if not port.is_allowed]
    group = "; on Linux, add yourself to the group dialout" if sys.platform == "linux" else ""
    problems = [f"you may not read and write {device}{group}" for device in denied]
    if ports and not _version_of("serial"):
        problems.append('serial ports need pyserial; install it: pip install "uavseg[serial]"')
    return facts, problems


@dataclass(frozen=True, slots=True)
class WarmUp:
    """What was done before the work begins."""

    shipped: int  # kernels whose machine code came with the package
    kept: int  # kernels that were compiled on this machine before
    compiled: int  # and those that were now
    libraries: int  # that were loaded
    seconds: float

    def __str__(self) -> str:
        kernels = self.shipped + self.kept + self.compiled
        return (
            f"{kernels} kernels are ready in {self.seconds:.1f} s: {self.shipped} came with the package, "
            f"{self.kept} were compiled before, {self.compiled} now; {self.libraries} libraries were loaded"
        )


@checked
def warm_up(processes: int | None = None, progress: Progress | None = None) -> WarmUp:
    """Load everything once, and compile what has to be compiled, so that later commands start at once.

    On Linux with an x86-64 processor nothing is compiled: kernels come with the package. Elsewhere they are
    compiled into the user's cache, by several processes at once.

    Parameters
    ----------
    processes : int, optional
        How many compile; by default one for each core that the process may use.
    progress : callable, optional
        Called with the number of steps done and the number of steps: one for each kernel and each library.

    Raises
    ------
    ParameterError
        If `processes` is below 1.
    OutputError
        If kernels have to be compiled and no folder can keep them.
    MissingLibraryError
        If a kernel has to be compiled and numba is not installed.

    Examples
    --------
    >>> import uavseg
    >>> done = uavseg.warm_up()
    >>> done.shipped + done.kept + done.compiled > 80
    True
    """
    start = time.perf_counter()
    count = usable_cores() if processes is None else processes
    if count < 1:
        raise ParameterError(f"the number of processes is at least 1, not {count}")
    kernels = warming.all_kernels()
    total = len(kernels) + len(_LIBRARIES)

    def report(done: int) -> None:
        if progress is not None:
            progress(done, total)

    found = warming.warm(kernels, count, report)
    for done, name in enumerate(_LIBRARIES, start=len(kernels) + 1):
        importlib.import_module(name)
        report(done)
    if found["compiled"] and object_cache.is_temporary(object_cache.cache_folder()):
        compiled = f"{found['compiled']} kernels were compiled"
        raise OutputError(f"{compiled}, but no folder can keep them; {_NAME_ONE}")
    seconds = time.perf_counter() - start
    return WarmUp(found["shipped"], found["kept"], found["compiled"], len(_LIBRARIES), seconds)


def find_qgis() -> str:
    """Return the version of the QGIS on the search path, such as "3.22.16-Białowieża"; empty where none is.

    It is started to ask for its version, without the variables of this environment.
    """
    found = [program for program in _PROGRAMS if shutil.which(program)]
    silent = "found, but it does not say its version" if found or shutil.which("qgis") else ""
    return next(filter(None, map(_qgis_version, found)), silent)


def _qgis_version(program: str) -> str:
    """Return what a program says in the line that begins with "QGIS"."""
    with tempfile.TemporaryDirectory(prefix="uavseg-") as folder:
        kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
        own = {"QT_QPA_PLATFORM": "offscreen"} | dict.fromkeys(_FOLDERS, folder)
        asked = [shutil.which(program) or program, "--version"]
        how: dict[str, Any] = {"env": kept | own, "timeout": _TIMEOUT_S, "stdin": subprocess.DEVNULL}
        try:
            answer = subprocess.run(asked, capture_output=True, check=False, **how)
        except (OSError, subprocess.TimeoutExpired):  # then it says nothing of itself
            return ""
    lines = answer.stdout.decode("utf-8", "replace").splitlines()
    said = next((line for line in lines if line.startswith("QGIS ")), "")
    return said.removeprefix("QGIS ").split(" '")[0].strip()
