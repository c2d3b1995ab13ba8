"""Copies of a process that share its work: they answer as the process itself would."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux")

HEAD = """
import json, os, signal, sys, threading, time
from uavseg.execution.executors import OWN_THREAD
from uavseg.execution.executors import can_fork, fork_each
came = []
def received(item, result):
    came.append([item, result])
"""


def answer(script: str) -> Any:
    """What a script prints as JSON: here, threads of the tests run beside."""
    found = subprocess.run(
        [sys.executable, "-c", HEAD + script],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
        cwd=Path(__file__).parents[2],
    )
    assert found.stderr == ""
    return json.loads(found.stdout)


@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_each_item_has_its_result(count: int) -> None:
    squares = answer(
        f"""
offset = 1
fork_each(lambda item: [item * item + offset, os.getpid()], range(20), {count}, received)
print(json.dumps([os.getpid(), came]))
"""
    )
    parent, came = squares
    assert sorted([item, result[0]] for item, result in came) == [[k, k * k + 1] for k in range(20)]
    copies = {result[1] for _, result in came}
    assert parent not in copies and len(copies) <= count


def test_an_item_whose_copy_is_killed_has_no_result() -> None:
    came = answer(
        """
def one(item):
    if item == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if item == 5:
        raise ZeroDivisionError
    return item

fork_each(one, range(20), 4, received)
print(json.dumps(came))
"""
    )
    assert sorted(came) == [[k, k] for k in range(20) if k not in (3, 5)]


def test_an_interrupt_stops_the_copies_and_keeps_what_came() -> None:
    left, came, ended = answer(
        """
from multiprocessing import get_context
asleep = get_context("fork").Event()

def one(item):
    if item == 4:
        try:
            asleep.set()
            time.sleep(50)
        except KeyboardInterrupt:
            return "interrupted"
    if item == 9:
        asleep.wait()
    return item

def stopping(item, result):
    received(item, result)
    if len(came) == 9:
        raise KeyboardInterrupt

begun = time.monotonic()
try:
    fork_each(one, range(10), 2, stopping)
except KeyboardInterrupt:
    pass
left = 0
try:
    os.waitpid(-1, os.WNOHANG)
    left = 1
except ChildProcessError:
    pass
print(json.dumps([left, came, time.monotonic() - begun < 30]))
"""
    )
    assert left == 0 and ended
    assert sorted(came) == [[k, "interrupted" if k == 4 else k] for k in range(10)]


def test_a_process_with_threads_of_others_is_not_copied() -> None:
    alone, with_ours, with_other = answer(
        """
alone = can_fork()
end = threading.Event()
threading.Thread(target=end.wait, name=OWN_THREAD + "bar").start()
with_ours = can_fork()
threading.Thread(target=end.wait).start()
with_other = can_fork()
end.set()
print(json.dumps([alone, with_ours, with_other]))
"""
    )
    assert alone and with_ours and not with_other


def test_other_threads_do_not_copy_the_process() -> None:
    answers = answer(
        """
answers = []
thread = threading.Thread(target=lambda: answers.append(can_fork()), name=OWN_THREAD)
thread.start()
thread.join()
print(json.dumps(answers))
"""
    )
    assert answers == [False]


@pytest.mark.slow
def test_copies_read_and_write_after_gdal_had_threads(tmp_path: Path) -> None:
    # a copy has none of the threads that GDAL keeps, and would wait for them for ever
    shapes = answer(
        f"""
import numpy as np
from uavseg.raster.formats.creation import CreationOptions
from uavseg.raster.formats.geotiff import read_geotiff, write_geotiff
from uavseg.raster.grid.geobox import local_geobox
box = local_geobox((1500, 1500), 1.0, (0.0, 0.0))
bands = np.random.default_rng(0).integers(0, 99, (1, 1500, 1500)).astype("u4")
threads = CreationOptions(threads=4)
def read(item):
    write_geotiff(f"{tmp_path}/{{item}}.tif", bands, box, [""], creation=threads)
    return read_geotiff(f"{tmp_path}/{{item}}.tif")[0].shape
read(9)
fork_each(read, [1, 2, 3], 2, received)
print(json.dumps(sorted(came)))
"""
    )
    assert shapes == [[k, [1, 1500, 1500]] for k in (1, 2, 3)]
