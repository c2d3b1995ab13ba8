"""Each case that an earlier campaign ended with is answered by a result or by one clear line."""

import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest

from tests.hostile import campaign
from tests.hostile.known_cases import FOLDER, known_cases

CASES = known_cases() if FOLDER.is_dir() else {}


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    with campaign.started_with_seeds() as pool:
        yield pool


@pytest.mark.slow
@pytest.mark.skipif(not CASES, reason="the folder of known cases, ../shared/hostile, does not exist")
def test_what_proj_says_of_a_reference_system_is_not_printed(tmp_path: Path) -> None:
    [raster] = FOLDER.glob("tif-RAWFD2-*/x.tif")  # in a process of its own: PROJ is told when it is loaded
    command = [sys.executable, "-m", "uavseg", "preview", str(raster), "-o", "p.png", "--width", "300"]
    environment = {name: value for name, value in os.environ.items() if name != "PROJ_DEBUG"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "no transformation to longitude and latitude" in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not CASES, reason="the folder of known cases, ../shared/hostile, does not exist")
@pytest.mark.parametrize("name", CASES)
def test_a_known_case_ends_cleanly(name: str, pool: ProcessPoolExecutor) -> None:
    case = CASES[name]
    assert pool.submit(campaign.judged, case).result() == []
