"""`uavseg doctor` and `uavseg.doctor`: what is installed, what is wrong, and no path of the user."""

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pyproj
import pytest
import rasterio
from click.testing import CliRunner

import uavseg
from uavseg._jit import warming
from uavseg._jit.kernels import Kernel
from uavseg.cli import main
from uavseg.flight.link.transport import SerialPort, serial_ports
from uavseg.jobs.install import doctor as doctor_job

FIND_QGIS = doctor_job.find_qgis  # which the fixture below replaces


@pytest.fixture(autouse=True)
def without_qgis(monkeypatch: pytest.MonkeyPatch) -> None:
    """QGIS takes seconds to say its version."""
    monkeypatch.setattr(doctor_job, "find_qgis", lambda: "")


def program(folder: Path, name: str, text: str) -> None:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(f"#!/bin/sh\n{text}\n")
    (folder / name).chmod(0o755)


def test_versions_are_those_of_the_libraries() -> None:
    facts = uavseg.doctor().facts
    assert facts["uavseg"] == uavseg.__version__
    assert f"GDAL {rasterio.__gdal_version__}" in facts["rasterio"]
    assert f"PROJ {rasterio.__proj_version__}" in facts["rasterio"]
    assert facts["pyproj"] == f"{pyproj.__version__}, with PROJ {pyproj.proj_version_str}"
    assert facts["EPSG database"] == "found" and facts["QGIS"] == "not found"


def test_each_extra_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    monkeypatch.setattr(doctor_job, "_version_of", lambda name: "" if name == "folium" else "1.2.3")
    facts = uavseg.doctor().facts
    said = {name.removeprefix("extra "): fact for name, fact in facts.items() if name.startswith("extra ")}
    assert said.keys() == extras.keys() - {"test", "dev", "docs", "bench"}
    assert said.pop("explore") == 'folium not installed: pip install "uavseg[explore]"'
    for extra, fact in said.items():
        named = [re.split(r"\W*[<>=]", one)[0] for one in extras[extra]]
        assert fact == ", ".join(f"{name} 1.2.3" for name in named)


def test_a_sound_installation_has_no_problems_and_exit_code_0() -> None:
    done = CliRunner().invoke(main, ["doctor"])
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[-1] == "no problems found" and not done.stderr


def test_both_faces_say_the_same() -> None:
    found = uavseg.doctor()
    assert CliRunner().invoke(main, ["doctor"]).stdout == f"{found}\n"
    assert json.loads(CliRunner().invoke(main, ["doctor", "--json"]).stdout) == found.as_dict()


def test_the_report_has_no_folder_of_the_user(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("UAVSEG_CACHE", str(tmp_path))
    monkeypatch.setenv("UAVSEG_JIT", "objects")
    text = str(uavseg.doctor())
    for path in (Path.home(), Path.cwd(), tmp_path, Path(uavseg.__file__).parent, Path(sys.prefix)):
        assert str(path) not in text
    assert "UAVSEG_CACHE, UAVSEG_JIT=objects" in text


@pytest.mark.slow
def test_nothing_is_compiled_and_what_is_in_the_cache_is_counted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("UAVSEG_CACHE", str(tmp_path))
    monkeypatch.setenv("UAVSEG_JIT", "objects")
    name, first = next(iter(warming.all_kernels().items()))
    fresh = Kernel(first.function, first.signature)
    assert warming.states({name: fresh}) == {"shipped": 0, "kept": 0, "missing": 1}
    assert not list(tmp_path.rglob("*.o"))
    Kernel(fresh.function, fresh.signature).load()
    assert warming.states({name: fresh}) == {"shipped": 0, "kept": 1, "missing": 0}


def test_kernels_that_cannot_be_compiled_are_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warming, "states", lambda kernels: {"shipped": 90, "kept": 0, "missing": 3})
    monkeypatch.setattr(doctor_job, "_version_of", lambda name: "" if name == "numba" else "1.0")
    [problem] = uavseg.doctor().problems
    assert problem.startswith("3 kernels have to be compiled") and 'pip install "uavseg[compile]"' in problem


@pytest.mark.parametrize(
    ("library", "file", "remedy"),
    [("shapely", "libgeos_c.so", "pip install"), ("pyogrio", "libexpat.so.1", "apt install libexpat1")],
)
def test_a_library_that_does_not_load_is_a_problem(
    library: str, file: str, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = importlib.import_module

    def damaged(name: str, package: str | None = None) -> Any:
        if name == library:
            raise ImportError(f"{file}: cannot open shared object file")
        return load(name, package)

    monkeypatch.setattr(doctor_job.importlib, "import_module", damaged)
    done = CliRunner().invoke(main, ["doctor"])
    assert done.exit_code == 1
    [line] = [line for line in done.stdout.splitlines() if line.startswith("problem: ")]
    assert line.startswith(f"problem: {library} cannot be loaded ({file}") and remedy in line


@pytest.mark.slow
def test_the_database_of_another_proj_is_a_problem_that_names_the_variable(tmp_path: Path) -> None:
    foreign = {**os.environ, "PROJ_DATA": str(tmp_path), "PATH": str(tmp_path)}
    foreign["PYTHONPATH"] = str(Path(uavseg.__file__).parents[1])
    (tmp_path / "proj.db").write_bytes(b"")
    done = subprocess.run(
        [sys.executable, "-m", "uavseg", "doctor"], capture_output=True, text=True, check=False, env=foreign
    )
    assert done.returncode == 1 and not done.stderr
    problems = [line for line in done.stdout.splitlines() if line.startswith("problem: ")]
    assert any("rasterio cannot look up" in line and "unset PROJ_DATA" in line for line in problems)
    assert str(tmp_path) not in done.stdout


def test_a_serial_port_without_permission_is_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [SerialPort("/dev/ttyACM0", "CubeOrange", True), SerialPort("/dev/ttyUSB1", "", False)]
    monkeypatch.setattr(doctor_job, "serial_ports", lambda: ports)
    found = uavseg.doctor()
    assert found.facts["serial ports"] == "/dev/ttyACM0 (CubeOrange), /dev/ttyUSB1"
    [problem] = found.problems
    assert problem.startswith("you may not read and write /dev/ttyUSB1")


def test_serial_ports_are_found_without_pyserial(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("ttyUSB1", "ttyACM0", "ttyS0", "null"):
        (tmp_path / name).touch()
    monkeypatch.setitem(sys.modules, "serial.tools", None)
    assert [Path(port.device).name for port in serial_ports(tmp_path)] == ["ttyACM0", "ttyUSB1"]


@pytest.mark.skipif(shutil.which("sh") is None, reason="a program of the shell")
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("echo 'noise'; echo \"QGIS 3.22.16-Name 'Name' (exported)\"", "3.22.16-Name"),
        ("exit 3", "found, but it does not say its version"),
        ('test -z "$PYTHONPATH" && echo "QGIS 4.0"', "4.0"),
    ],
)
def test_qgis_says_its_version(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str, expected: str
) -> None:
    program(tmp_path / "bin", "qgis_process", text)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("PYTHONPATH", "/somewhere")
    assert FIND_QGIS() == expected


@pytest.mark.skipif(shutil.which("sh") is None, reason="a program of the shell")
def test_what_qgis_writes_stays_out_of_the_home_of_the_user(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program(tmp_path / "bin", "qgis_process", 'echo settings > "$HOME/left" && echo "QGIS 3.40"')
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert FIND_QGIS() == "3.40"
    assert not (tmp_path / "left").exists()


def test_no_qgis(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert FIND_QGIS() == ""
