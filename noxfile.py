"""What one runs: `nox -s fast`, `tests`, `lint`, `docs`, `bench`, `kernels`, `hostile`; `nox -l` lists more.

``nox -s lowest`` and ``nox -s newest`` run the main job and the fast tests on each Python that is installed,
with the lowest version of every dependency that pyproject.toml allows and with the newest; ``-- job`` or
``-- tests`` after them runs one of the two. All main jobs of a call must write the same bytes. With the
lowest versions those tests run in which dependencies decide (`LIBRARIES`), and the tests of kernels through
numba (`UAVSEG_JIT`). A Python that is not installed is named and skipped.
"""

import hashlib
import os
import re
import shutil
import tarfile
import tomllib
import zipfile
from pathlib import Path

import nox

nox.options.sessions = ["fast", "lint"]
nox.options.reuse_existing_virtualenvs = True

PYTHONS = ["3.11", "3.12", "3.13"]
ROOT = Path(__file__).resolve().parent
JOB = """
extract {samples}/quarry.tif --range 0.55,1 --mission quarry.plan --altitude 60 --home auto
extract {samples}/shore.tif --range 0.5,1 -o land.kml --labels land.tif --smooth-outline 1 --min-area 50
extract {samples}/fields_rgb.tif --range 0.54,1 -o fields.geojson --method paper --fill-holes 10px
extract {samples}/thermal.tif --stretch 28000,31500 --range 0.25,1 -o warm.gpkg
levels {samples}/quarry.tif --width 0.2 --min-area 50 -o levels.geojson
divide {samples}/quarry.tif -o blocks.tif
suggest {samples}/quarry.tif -o ranges.png
match {samples}/fields_rgb.tif --like 548225,6471890,4 -o like.geojson
simulate circles -o map.tif --truth truth.tif
classify map.tif --stretch none -o states.tif --objects objects.geojson
path map.tif --range 0,0.45 --start 0.715,1.595 --goal 2.135,0.305 --smooth -o path.geojson
plan quarry.regions.geojson -o survey.waypoints --altitude 60 --home auto --pattern survey --spacing 15
preview {samples}/quarry.tif --regions quarry.regions.geojson -o quarry.png
"""
# Files, geometry, drawing, servers and clusters; what is left out is our own arithmetic, and what these call.
LIBRARIES = """
api cli execution flight/cover flight/formats flight/safety occupancy/bags occupancy/ros output plot raster
regions server test_both_faces.py test_same_bytes.py test_warning_filters.py
"""
ARITHMETIC = """
raster/collar raster/intensity raster/spectral regions/outline regions/smooth regions/tiles
"""
KERNELS = "jit segmentation occupancy/paths"
SAME = {".geojson", ".kml", ".plan", ".waypoints"}  # the others hold what GDAL and matplotlib add to them
_jobs: dict[str, dict[str, str]] = {}


@nox.session
def fast(session: nox.Session) -> None:
    """Each command, function and file format; without long comparisons, clusters and killed processes."""
    session.install("-e", ".[test]")
    session.run("pytest", "-n", "auto", "-m", "not slow and not thorough", *session.posargs)


@nox.session
def thorough(session: nox.Session) -> None:
    """More cases of what the check tries a few of: faults, damaged files, references, formats, kernels."""
    session.install("-e", ".[test]")
    session.run("pytest", "-n", "auto", "-m", "thorough", *session.posargs)


@nox.session
def tests(session: nox.Session) -> None:
    """All tests but the thorough ones, with coverage and its floor."""
    session.install("-e", ".[test]")
    session.run("pytest", "-n", "auto", "--cov", *session.posargs)


@nox.session
def lint(session: nox.Session) -> None:
    """Style, format and types."""
    session.install("-e", ".[dev,bench]")
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("mypy")


@nox.session
def docs(session: nox.Session) -> None:
    """The documentation site; a warning is an error."""
    session.install("-e", ".[docs]")
    session.run("sphinx-build", "-W", "--keep-going", "-q", "docs", "build/docs", *session.posargs)


@nox.session
def bench(session: nox.Session) -> None:
    """Benchmarks: `nox -s bench -- --help` says which there are."""
    session.install("-e", ".[bench,test]")
    session.run("python", "-m", "benchmarks", *session.posargs)


@nox.session
def kernels(session: nox.Session) -> None:
    """Compile the kernels of the package where they changed; `-- all` for all levels, `-- --again` again."""
    session.install("-e", ".[compile]", env={"UAVSEG_BUILD_KERNELS": "none"})
    session.run("python", "-m", "build_kernels.libraries", *session.posargs)


@nox.session
def hostile(session: nox.Session) -> None:
    """100 000 damaged files and wrong arguments, or `-- 4000`; ends with what was found."""
    session.install("-e", ".[test]")
    cores = str(len(os.sched_getaffinity(0)))
    session.run("python", "-m", "tests.hostile", *(session.posargs or ["100000"]), "--processes", cores)


@nox.session
def honest(session: nox.Session) -> None:
    """30 000 honest inputs, each also answered by code that shares none of ours, or `-- 3000`."""
    session.install("-e", ".[test]")
    cores = str(len(os.sched_getaffinity(0)))
    session.run("python", "-m", "tests.honest", *(session.posargs or ["30000"]), "--processes", cores)


@nox.session
def distributions(session: nox.Session) -> None:
    """The wheel and the sdist hold each file of the package, install in empty environments, and run alike."""
    session.install("build")
    folder = Path(session.create_tmp()).resolve() / "distributions"
    shutil.rmtree(folder, ignore_errors=True)
    listed = session.run("git", "-C", str(ROOT), "ls-files", external=True, silent=True)
    tracked = str(listed).splitlines()
    source_folder = folder / "source"  # without what an earlier build has left in this one
    for name in tracked:
        (source_folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, source_folder / name)
    everywhere = {"UAVSEG_BUILD_KERNELS": "all"}
    build = ("python", "-m", "build", "--outdir", str(folder), str(source_folder))
    session.run(*build, silent=True, env=everywhere)
    [wheel], [sdist] = folder.glob("*.whl"), folder.glob("*.tar.gz")
    expected = {name for name in tracked if name.startswith("uavseg/")}
    libraries = {f"uavseg/_jit/libraries/{level}.so" for level in ("x86-64", "x86-64-v3", "x86-64-v4")}
    with zipfile.ZipFile(wheel) as archive, tarfile.open(sdist) as source:
        inside = {
            wheel: archive.namelist(),
            sdist: [member.name.partition("/")[2] for member in source.getmembers() if member.isfile()],
        }
    building = {name for name in tracked if name.startswith("build_kernels/")}  # in the sdist alone
    for file, names in inside.items():
        held = expected | (libraries if file == wheel else building)
        folders = ("uavseg/", "build_kernels/")
        different = sorted({name for name in names if name.startswith(folders)} ^ held)
        if different:
            session.error(f"{file.name} and the folder differ in: {', '.join(different)}")
    found = {file.name: installed_job(session, file) for file in (wheel, sdist)}
    if len(set(found.values())) != 1:
        session.error("the regions of the wheel are not those of the sdist")


def installed_job(session: nox.Session, file: Path) -> str:
    """Install a distribution into an empty environment and run its programs; the hash of what they wrote."""
    environment = file.with_name(f"of-{file.name}")
    session.run("python", "-m", "venv", str(environment))
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    install = (str(programs / "python"), "-m", "pip", "install", "-q", "--no-compile", str(file))
    session.run(*install, external=True, env={"UAVSEG_BUILD_KERNELS": "here"})
    raster, run = ROOT / "samples" / "quarry.tif", programs / "uavseg"
    with session.chdir(environment):
        for line in (
            (run, "doctor"),
            (run, "extract", raster, "--range", "0.55,1", "-o", "regions.geojson", "-q"),
            (run, "plan", "regions.geojson", "--altitude", "60", "--home", "auto", "-o", "fly.plan", "-q"),
            (
                run,
                "map",
                raster,
                "--regions",
                "regions.geojson",
                "--mission",
                "fly.plan",
                "-o",
                "map.html",
                "-q",
            ),
            (programs / "rio", "uavseg", "cameras"),
        ):
            session.run(*map(str, line), external=True, env={"PYTHONPATH": ""}, silent=True)
    written = [environment / name for name in ("regions.geojson", "fly.plan", "map.html")]
    return hashlib.sha256(b"".join(path.read_bytes() for path in written)).hexdigest()


@nox.session(python=PYTHONS)
def lowest(session: nox.Session) -> None:
    """The lowest versions of the dependencies."""
    constraints = Path(session.create_tmp()) / "lowest.txt"
    constraints.write_text("\n".join(floors()))
    session.install("-e", ".[test]", "-c", str(constraints))
    check(session)


@nox.session(python=PYTHONS)
def newest(session: nox.Session) -> None:
    """The newest versions of the dependencies."""
    session.install("-e", ".[test]", "--upgrade", "--upgrade-strategy", "eager")
    check(session)


def floors() -> list[str]:
    """Each dependency of the package and of its tests at the lowest version that pyproject.toml allows."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    parts = ("test", "cluster", "compile", "explore", "notebook", "parquet", "serial")
    wanted = [*project["dependencies"], *(text for part in parts for text in extras[part])]
    split = [
        re.fullmatch(r"([\w-]+)>=([\w.]+)(?:;.*)?", text) for text in wanted if not text.startswith("uavseg")
    ]
    assert all(split), f"expected NAME>=VERSION of every dependency, got {wanted}"
    return sorted({f"{found[1]}=={found[2]}" for found in split if found})


def check(session: nox.Session) -> None:
    """Run the main job and the fast tests, or one of them."""
    session.run("python", "-m", "pip", "freeze", "--exclude-editable")
    if "tests" not in session.posargs:
        job(session)
    if "job" not in session.posargs:
        # With old versions, libraries warn that others change.
        deprecated = ["-W", "ignore::DeprecationWarning", "-W", "ignore::PendingDeprecationWarning"]
        suite = ["python", "-m", "pytest", "-m", "not slow and not thorough", "-n", "auto"]
        if session.name.startswith("lowest"):
            libraries, ours, kernels = (
                [f"tests/{name}" for name in names.split()] for names in (LIBRARIES, ARITHMETIC, KERNELS)
            )
            session.run(*suite, *deprecated, *libraries, *(f"--ignore={folder}" for folder in ours))
            session.run(*suite, *deprecated, *kernels, env={"UAVSEG_JIT": "numba"})
        else:
            session.run(*suite)


def job(session: nox.Session) -> None:
    """Run commands over the samples; what they write is the same in all sessions of this call."""
    folder = Path(session.create_tmp()) / "job"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    with session.chdir(folder):
        for line in JOB.strip().splitlines():
            session.run("uavseg", *line.format(samples=ROOT / "samples").split())
    files = sorted(folder.rglob("*"))
    assert all(path.stat().st_size for path in files), "a file is empty"
    found = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files if path.suffix in SAME
    }
    first, expected = next(iter(_jobs.items()), (session.name, found))
    _jobs[session.name] = found
    different = sorted(name for name in expected | found if expected.get(name) != found.get(name))
    if different:
        session.error(f"not the bytes of {first}: {', '.join(different)}")
