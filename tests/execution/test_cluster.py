"""Cluster executor: the same bytes whatever happens to workers, and one line for each kind of failure."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result

pytest.importorskip("distributed", reason="dask.distributed is not installed")

from uavseg.cli import main
from uavseg.errors import ClusterError, ParameterError, RasterReadError
from uavseg.execution import cluster
from uavseg.jobs.extract import ExtractRequest, extract, extract_partitions
from uavseg.jobs.source.source import Raster
from uavseg.jobs.source.work import Work
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.raster.grid.geobox import local_geobox
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.params.segment import IntensityRange

ROOT = Path(__file__).resolve().parents[2]
QUARRY = ROOT / "samples" / "quarry.tif"
RANGE = ("--range", "0.55,1")
BRIGHT = ExtractRequest(IntensityRange(0.55, 1))
pytestmark = pytest.mark.slow


def write(path: Path, image: np.ndarray, **how: Any) -> Path:
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    rows, cols = image.shape
    with rasterio.open(path, "w", "GTiff", cols, rows, 1, dtype=image.dtype.name, **place, **how) as file:
        file.write(image, 1)
    return path


def scene(shape: tuple[int, int] = (700, 900), kind: str = "uint16") -> np.ndarray:
    rng = np.random.default_rng(5)
    coarse = rng.integers(20, 240, (shape[0] // 30 + 1, shape[1] // 30 + 1))
    image = np.kron(coarse, np.ones((30, 30)))[: shape[0], : shape[1]] + rng.normal(0, 12, shape)
    return (np.clip(image, 1, 255) * 90).astype(kind)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def done(*arguments: object) -> Result:
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result


def refused(*arguments: object) -> str:
    """The one line on stderr."""
    result = run(*arguments)
    lines = result.stderr.splitlines()
    assert result.exit_code == 1 and len(lines) == 1 and result.stdout == "", result.output
    return lines[0].removeprefix("uavseg: error: ")


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture
def work(processes: Any) -> Iterator[cluster.Cluster]:
    """An executor on the workers."""
    with cluster.dask(processes.address) as made:
        yield made  # type: ignore[misc]


# The same as on one machine


@pytest.mark.parametrize("kind", ["uint16", "float32"])
def test_extract_and_divide_give_the_same_bytes(processes: Any, tmp_path: Path, kind: str) -> None:
    raster = write(tmp_path / "tile.tif", scene(kind=kind))
    found = []
    for name, how in (("here", ("--threads", 2)), ("there", ("--scheduler", processes.address))):
        (tmp_path / name).mkdir()
        out = tmp_path / name
        with chdir(tmp_path):  # the raster's path is relative, and the workers work elsewhere
            labels = ("--labels", out / "a.vrt", "--fill-holes", "90px", "--tile", 128, "-q")
            done("extract", raster.name, *RANGE, "-o", out / "a.gpkg", *labels, *how)
            done("divide", raster.name, "-o", out / "blocks.tif", "--tile", 192, "-q", *how)
            answer = ("-o", out / "b.fgb", "--labels", out / "b.tif", "-q", "--allow-path", tmp_path)
            done("extract", out / "blocks.tif", *RANGE, *answer, *how)
        found.append(contents(out))
    assert found[0].keys() == found[1].keys() and len(found[0]) >= 6
    assert [name for name in found[0] if found[0][name] != found[1][name]] == []


def test_files_of_partitions_are_the_same_bytes(work: cluster.Cluster, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    raster = Raster(Dataset.open(write(tmp_path / "tile.tif", scene())))
    for name, how in (("here", Work(192)), ("there", Work(128, work))):
        (tmp_path / name).mkdir()
        extract_partitions(raster, BRIGHT, tmp_path / name / "a.parquet", how, side=256)
    here, there = (contents(tmp_path / name) for name in ("here", "there"))
    assert here == there and len(here) > 4


def test_levels_and_states_are_the_same_bytes(processes: Any, tmp_path: Path) -> None:
    raster = write(tmp_path / "tile.tif", scene())
    states = np.searchsorted([20000, 30000], scene((300, 280))) + 1
    write_ros_map(tmp_path / "ros.yaml", states, local_geobox(states.shape, 0.05, (0, 0)))
    found = []
    for name, how in (("here", ("--threads", 2)), ("there", ("--scheduler", processes.address))):
        (tmp_path / name).mkdir()
        out = tmp_path / name
        with chdir(tmp_path):
            work = ("--tile", 128, "-q", *how)
            done(
                "levels", raster.name, "--width", 0.1, "-o", out / "a.gpkg", "--labels", out / "a.vrt", *work
            )
            objects = ("--objects", out / "b.fgb", "--labels", out / "b.tif")
            done("classify", raster.name, "-o", out / "s.tif", *objects, *work)
            done("classify", "ros.yaml", "-o", out / "ros.yaml", "--objects", out / "ros.fgb", *work)
        found.append(contents(out))
    assert found[0].keys() == found[1].keys() and len(found[0]) >= 8
    assert [name for name in found[0] if found[0][name] != found[1][name]] == []


def test_a_mosaic_of_relative_paths_is_read_by_workers_elsewhere(processes: Any, tmp_path: Path) -> None:
    image = scene()
    grid = Affine(2, 0, 4e5, 0, -2, 5e6)
    for k, part in enumerate((image[:320], image[320:])):
        with rasterio.open(
            tmp_path / f"{k}.tif", "w", "GTiff", 900, len(part), 1, "EPSG:32618",
            grid @ Affine.translation(0, 320 * k), "uint16",
        ) as file:  # fmt: skip
            file.write(part, 1)
    with chdir(tmp_path):
        done("extract", "0.tif", "1.tif", *RANGE, "-o", "one.geojson", "-q")
        done("extract", "0.tif", "1.tif", *RANGE, "-o", "two.geojson", "-q", "--scheduler", processes.address)
    assert (tmp_path / "one.geojson").read_bytes() == (tmp_path / "two.geojson").read_bytes()


def test_no_pixels_travel(work: cluster.Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = {"items": 0, "results": 0}
    pack, unpack = cluster.pack_value, cluster.unpack_value

    def counted(name: str, content: bytes) -> bytes:
        sizes[name] += len(content)
        return content

    monkeypatch.setattr(cluster, "pack_value", lambda value: counted("items", pack(value)))
    monkeypatch.setattr(cluster, "unpack_value", lambda content: unpack(counted("results", content)))
    image = np.kron(scene((256, 256)) // 9000, np.ones((8, 8), np.uint16)) * 9000
    raster = write(tmp_path / "tile.tif", image.astype(np.uint16))
    extract(Raster(Dataset.open(raster)), BRIGHT, Work(1024, work))
    assert 0 < sizes["items"] < 0.02 * image.size
    assert 0 < sizes["results"] < 0.2 * image.size  # of 2 bytes each


# The executor


def test_results_come_in_the_order_of_the_items(work: cluster.Cluster) -> None:
    reported: list[tuple[int, int]] = []
    found = list(work(abs, range(-40, 0), lambda *share: reported.append(share)))
    assert found == list(range(40, 0, -1))
    assert reported == [(k, 40) for k in range(1, 41)]
    assert list(work(abs, [])) == []


def test_a_consumer_that_stops_stops_the_work(work: cluster.Cluster) -> None:
    class Items(list[int]):
        requested = 0

        def __iter__(self) -> Iterator[int]:
            for item in list.__iter__(self):
                self.requested += 1
                yield item

    items = Items(range(1000))
    results = work(abs, items)
    assert [next(results), next(results)] == [0, 1]
    results.close()  # type: ignore[attr-defined]
    assert items.requested <= 2 + 5 * cluster.IN_FLIGHT
    assert list(work(abs, [-1])) == [1]


def test_errors_keep_their_type_and_name_the_worker(work: cluster.Cluster) -> None:
    from uavseg.execution.executors import threads

    with pytest.raises(ParameterError, match=r"at least 1, not -3 \(on the worker tcp://127.*, host \S+\)$"):
        list(work(threads, [-3]))
    with pytest.raises(TypeError):
        list(work(abs, ["a"]))


# What happens to workers


def test_a_worker_killed_in_the_middle_changes_nothing(
    processes: Any, work: cluster.Cluster, tmp_path: Path
) -> None:
    dataset = Dataset.open(write(tmp_path / "tile.tif", scene()))
    wanted = extract(Raster(dataset), BRIGHT, Work(64))
    killed = []

    def kill(done: int, total: int) -> None:
        if done > total // 2 and not killed:
            killed.append(processes.workers.pop())
            killed[0].send_signal(signal.SIGKILL)

    found = extract(Raster(dataset), BRIGHT, Work(64, work, progress=kill))
    assert killed[0].wait(20) == -signal.SIGKILL
    processes.add(1)
    assert len(wanted.regions) > 10 and np.array_equal(found.rings.vertices, wanted.rings.vertices)
    assert found.regions.frame().to_wkb().equals(wanted.regions.frame().to_wkb())


def test_an_item_that_kills_every_worker_is_an_error(
    tmp_path: Path, processes: Any, work: cluster.Cluster
) -> None:
    """Each worker that gets this item dies; after four the scheduler gives up."""
    processes.add(4)
    with pytest.raises(ClusterError, match=r"workers died one after the other .* tcp://127"):
        list(work(os._exit, [1]))
    processes.add(4)
    assert list(work(abs, [-1])) == [1]


def test_a_raster_missing_on_a_worker_is_named_with_the_worker(processes: Any, tmp_path: Path) -> None:
    raster = write(tmp_path / "tile.tif", scene())
    dataset = Dataset.open(raster)
    raster.unlink()  # as on another machine
    with (
        cluster.dask(processes.address) as work,
        pytest.raises(RasterReadError, match=rf"there is no file {raster} \(on the worker tcp://\S+, host"),
    ):
        extract(Raster(dataset), BRIGHT, Work(executor=work))


# What is refused


def test_without_a_scheduler_there_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    with chdir(tmp_path):
        for address in ("tcp://127.0.0.1:9", "carrier-pigeon://here"):
            line = refused("extract", QUARRY, *RANGE, "--scheduler", address)
            assert line.startswith(f"no scheduler answers at {address} (") and "dask scheduler" in line
    assert list(tmp_path.iterdir()) == []


def test_without_distributed_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with chdir(tmp_path):
        line = refused("divide", QUARRY, "-o", "a.tif", "--scheduler", "tcp://127.0.0.1:9")
    assert line == '--scheduler needs dask.distributed; install it with: pip install "uavseg[cluster]"'


def test_threads_and_a_scheduler_exclude_each_other(tmp_path: Path) -> None:
    result = run("extract", QUARRY, *RANGE, "-o", "-", "--threads", 2, "--scheduler", "tcp://127.0.0.1:9")
    assert result.exit_code == 2 and "give one of the two" in result.stderr


def test_workers_of_another_version_are_refused(processes: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("uavseg.__version__", "7.0.0")
    with pytest.raises(ClusterError, match=r"worker tcp://\S+ has uavseg \d\S+ where this side has 7\.0\.0"):
        cluster.dask(processes.address)


PACKAGES = ("numpy", "numba", "llvmlite", "rasterio", "shapely", "pyproj", "distributed")
LIBRARIES = {
    "GDAL": "rasterio.__gdal_version__",
    "PROJ in rasterio": "rasterio.__proj_version__",
    "PROJ": "pyproj.proj_version_str",
    "GEOS": "shapely.geos_version_string",
    "Python": "uavseg.execution.cluster.python_version",
}


@pytest.mark.parametrize("name", [*PACKAGES, *LIBRARIES])
def test_any_version_that_may_change_bytes_is_compared(
    processes: Any, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """One package has another version here, so all workers differ."""
    if name in PACKAGES:
        true = cluster.version
        monkeypatch.setattr(
            cluster, "version", lambda requested: "7.0.0" if requested == name else true(requested)
        )
    else:
        monkeypatch.setattr(LIBRARIES[name], (lambda: "7.0.0") if name == "Python" else "7.0.0")
    with pytest.raises(ClusterError, match=rf"^the worker tcp://\S+ has {name} \S+ where this side has 7\.0"):
        cluster.dask(processes.address)


OTHER_VERSIONS = """
import importlib.metadata
import rasterio

true = importlib.metadata.version
importlib.metadata.version = lambda name: "0.1.2" if name == "numba" else true(name)
rasterio.__gdal_version__ = "3.4.5"
"""
OTHERS_ARE_TOLD = (
    r"has numba 0\.1\.2 where this side has \S+, GDAL 3\.4\.5 where this side has \S+; "
    "install the same on both"
)


@pytest.fixture
def unlike(other: Any) -> str:
    """A search path with another numba and another GDAL."""
    (other.folder / "sitecustomize.py").write_text(OTHER_VERSIONS)
    return f"{other.folder}{os.pathsep}{ROOT}"


def test_a_worker_with_other_libraries_is_refused_and_all_are_named(other: Any, unlike: str) -> None:
    other.add(1)
    other.add(1, path=unlike)
    present(other, 2)
    with pytest.raises(ClusterError, match=rf"^the worker tcp://\S+ {OTHERS_ARE_TOLD}$"):
        cluster.dask(other.address)


def test_a_worker_with_other_libraries_that_joins_later_is_refused(other: Any, unlike: str) -> None:
    with cluster.dask(other.address) as work:
        other.add(1, path=unlike)
        with pytest.raises(ClusterError, match=rf"^a worker {OTHERS_ARE_TOLD} \(on the worker tcp://"):
            list(work(abs, [-1]))


WITHOUT_UAVSEG = """
import sys


class Absent:
    def find_spec(self, name, path=None, target=None):
        if name == "uavseg":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


sys.meta_path.insert(0, Absent())
"""


def test_workers_without_uavseg_are_refused(other: Any) -> None:
    (other.folder / "sitecustomize.py").write_text(WITHOUT_UAVSEG)  # it may be installed
    other.add(1, path=str(other.folder))
    present(other, 1)
    with pytest.raises(ClusterError, match=r"worker tcp://\S+ has no uavseg .*No module named 'uavseg'"):
        cluster.dask(other.address)


def test_a_scheduler_without_workers_is_an_error(other: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "NO_WORKERS_S", 0.1)
    with (
        cluster.dask(other.address) as work,
        pytest.raises(ClusterError, match=r"has no workers; start some with: dask worker tcp://127"),
    ):
        list(work(abs, [-1]))


def test_a_lost_scheduler_is_an_error(other: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    import dask

    other.add(1)
    present(other, 1)
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}), cluster.dask(other.address) as work:
        results = work(time.sleep, [0, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
        next(results)
        other.stop()
        with pytest.raises(ClusterError, match=r"scheduler at tcp://\S+ was lost during the run"):
            list(results)


@pytest.fixture
def other(processes: Any, tmp_path: Path) -> Iterator[Any]:
    """Another scheduler, without workers."""
    started = type(processes)(tmp_path)
    yield started
    started.stop()


def present(started: Any, count: int) -> None:
    from distributed import Client

    with Client(started.address, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=60)
