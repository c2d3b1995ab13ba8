"""pandas is imported on first use, by any command, without a list of commands."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

import uavseg
from uavseg.cli import main
from uavseg.regions.formats import export
from uavseg.regions.table import Regions

pytestmark = pytest.mark.slow

PACKAGE = Path(uavseg.__file__).resolve().parent
QUARRY = PACKAGE.parent / "samples" / "quarry.tif"

RUN = """
import sys
from contextlib import suppress
from uavseg.__main__ import run

def command(*words):
    sys.argv = ["uavseg", *words]
    with suppress(SystemExit):
        run()

def loaded():
    return [name for name in ("pandas", "geopandas") if name in sys.modules]
"""
USE_WRITERS = """
import numpy, pyarrow, pyogrio.raw
pyarrow.record_batch([pyarrow.array(numpy.zeros(1))], names=["a"])
assert pyogrio._compat.HAS_GEOPANDAS and pyogrio._compat.PANDAS_GE_20
"""
USE_FRAMES = """
import geopandas, pandas
frame = geopandas.read_file(path)
assert frame["mean"].isna().tolist() == [False, True]
frame.to_parquet(path + ".parquet")
for again in (geopandas.read_parquet(path + ".parquet"), geopandas.read_file(path, use_arrow=True)):
    assert again.equals(frame)
import pyarrow
assert pyarrow.array(pandas.Series([1, None, float("nan")])).null_count == 2
for missing in (None, pandas.NA, pandas.NaT):
    assert pyarrow.array(pandas.Series([1, missing], dtype=object)).null_count == 1
    assert pyarrow.array([1, missing], from_pandas=True).null_count == 1
assert "FileLoader" in type(pandas.__loader__).__name__ and pandas.__spec__.loader is pandas.__loader__
"""


def program(*parts: str, path: Path | None = None) -> None:
    """Run a script in a child process; it can use `path`."""
    search = os.pathsep.join([str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")])
    script = "\n".join([f"path = {str(path)!r}", *parts])
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": search},
        timeout=100,
    )
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two regions, one without a mean."""
    path = tmp_path_factory.mktemp("regions") / "two.gpkg"
    columns = {"id": np.array([1, 2]), "mean": np.array([0.5, np.nan])}
    squares = np.array([shapely.box(n, 0, n + 1, 1) for n in range(2)], dtype=object)
    export.write_regions(Regions(columns, squares, 'LOCAL_CS["here",UNIT["metre",1]]'), path)
    return path


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.thorough if n % 3 else [])
        for n, name in enumerate(main.list_commands(None))  # type: ignore[arg-type]
    ],
)
def test_any_command_can_create_frames(name: str, file: Path) -> None:
    program(RUN, f"command({name!r}, '--help')", USE_WRITERS, "assert loaded() == []", USE_FRAMES, path=file)


@pytest.mark.parametrize("before", ["import pyarrow", "import pyogrio", "import pandas", "import geopandas"])
def test_modules_imported_before_the_program_stay_unchanged(before: str, file: Path) -> None:
    program(before, RUN, "command('--help')", USE_WRITERS, USE_FRAMES, path=file)


def test_frames_can_be_created_before_anything_else(file: Path) -> None:
    program(RUN, "command('--help')", USE_FRAMES, USE_WRITERS, path=file)


def test_pyarrow_and_pyogrio_detect_a_missing_pandas() -> None:
    absent = "sys.modules['pandas'] = sys.modules['geopandas'] = None"
    program(RUN, absent, "command('--help')", "import pyogrio", "assert not pyogrio._compat.HAS_GEOPANDAS")


@pytest.mark.parametrize("suffix", ["gpkg", "parquet", "geojson", "shp"])
def test_extract_does_not_import_pandas(suffix: str, tmp_path: Path) -> None:
    output = tmp_path / f"a.{suffix}"
    words = ["extract", str(QUARRY), "--range", "0.55,1", "-q", "-o", str(output)]
    program(RUN, f"command(*{words!r})", "assert loaded() == [], loaded()")
    assert output.stat().st_size > 100
