"""How large the program may become, and what a run may load; a bound is raised only with a reason."""

import json
import os
import re
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import pytest

from tests.test_imports import PACKAGE, imports, modules

ROOT = PACKAGE.parent
MAX_LINES, MAX_FILES = 67_999, 351  # of the package, in Python
MAX_LAZY = 269  # imports of our modules within functions, such as of commands, which load what they need
LAZY_FOLDERS = {"cli", "jobs", "plot", "raster", "options", "regions", "flight", "execution", "__main__"}
MAX_STARTED = 141  # modules of ours that `uavseg extract` of one tile loads
MAX_ENTERED = 98  # files of which it calls a function
MAX_WORKING = 37  # those of jobs, segmentation and regions among them

ENTERED = """
import json, sys, threading
entered = set()
def look(frame, event, _):
    code = frame.f_code
    if event == "call" and code.co_name not in ("<module>", "<lambda>"):
        entered.add(code.co_filename)
from uavseg.cli import main
threading.setprofile(look); sys.setprofile(look)
main(["extract", {raster!r}, "--range", "0.55,1", "-o", {output!r}, "-q"], standalone_mode=False)
sys.setprofile(None)
entered = sorted(name for name in entered if name.startswith({package!r}))
print(json.dumps([entered, [name for name in sys.modules if name.split(".")[0] == "uavseg"]]))
"""


@cache
def extracting() -> tuple[list[str], list[str]]:
    """Files whose functions `uavseg extract` of a small tile enters, and modules that it loads."""
    with tempfile.TemporaryDirectory() as folder:
        script = ENTERED.format(
            package=str(PACKAGE),
            raster=str(ROOT / "samples" / "quarry.tif"),
            output=str(Path(folder) / "a.geojson"),
        )
        search = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        environment = {**os.environ, "PYTHONPATH": search}
        run = subprocess.run(
            [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
        )
    assert run.returncode == 0, run.stderr
    entered, loaded = json.loads(run.stdout.splitlines()[-1])
    return [str(Path(name).relative_to(PACKAGE)) for name in entered], loaded


def test_the_package_is_no_larger() -> None:
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in modules().values())
    assert lines <= MAX_LINES and len(modules()) <= MAX_FILES


@pytest.mark.slow
def test_extracting_loads_and_enters_no_more() -> None:
    entered, loaded = extracting()
    assert len(loaded) <= MAX_STARTED
    assert len(entered) <= MAX_ENTERED
    assert sum(name.startswith(("jobs", "segmentation", "regions")) for name in entered) <= MAX_WORKING


def test_lazy_imports_are_counted() -> None:
    ours = [one for one in imports() if not one.now and not one.for_types and one.imported in modules()]
    assert len(ours) <= MAX_LAZY
    assert {one.importer.split(".")[1] for one in ours} <= LAZY_FOLDERS


def test_options_are_declared_in_one_place() -> None:
    """click has options from the table alone, beside those of the group itself, such as --version."""
    declared = re.compile(r"click\.(option|argument|Option|Argument)\(")
    places = {name for name, path in modules().items() if declared.search(path.read_text(encoding="utf-8"))}
    assert places == {"uavseg.cli", "uavseg.cli.command"}


def test_no_binary_is_in_git() -> None:
    listed = subprocess.run(
        ["git", "ls-files", "-z", "uavseg", "build_kernels", "qgis_uavseg", "tests"],
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    if listed.returncode != 0:
        pytest.skip("not a clone of the repository")
    paths = [ROOT / name for name in listed.stdout.decode().split("\0") if name]
    assert len(paths) > 400
    pictures = {".png", ".jpg", ".ico", ".gif"}
    assert not [
        path for path in paths if path.suffix not in pictures and path.exists() and b"\0" in path.read_bytes()
    ]
