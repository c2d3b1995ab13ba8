"""Files that end early, as where reading fails: one clear line at whatever byte they end, or a whole result."""

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor

import pytest

from tests.hostile import campaign, seeds
from tests.hostile.case import Case

FLIGHT = ("-o", "out.plan", "--altitude", "50", "--home", "auto")
PLANNED = ("r.geojson", "r.gpkg", "r.fgb", "r.parquet", "r.shp", "r.shx", "r.dbf", "r.prj", "r.kml", "r.csv")
PARTS = ("r.shp", "r.shx", "r.dbf", "r.prj", "r.cpg")


@pytest.fixture(params=[16, pytest.param(40, marks=pytest.mark.thorough)])
def lengths(request: pytest.FixtureRequest) -> int:
    """At how many lengths each file ends."""
    return int(request.param)


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    with campaign.started_with_seeds() as pool:
        yield pool


Check = Callable[[dict[str, bytes], str, tuple[str, ...]], None]


@pytest.fixture
def check(pool: ProcessPoolExecutor, lengths: int) -> Check:
    """Run a command with a file cut off at many lengths."""

    def run(files: dict[str, bytes], name: str, command: tuple[str, ...]) -> None:
        content = files[name]
        found = {}
        for n in range(lengths):
            length = n * len(content) // lengths
            case = Case(files | {name: content[:length]}, (command,))
            found[length] = pool.submit(campaign.judged, case).result()
        assert not any(found.values()), {length: what for length, what in found.items() if what}

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        one if k % 3 == 0 else pytest.param(one, marks=pytest.mark.thorough)
        for k, one in enumerate(seeds.rasters())
    ],
)
def test_a_raster(check: Check, name: str) -> None:
    command = ("extract", "x.tif", "--range", "0.4,1", "-o", "out.gpkg", "--threads", "1")
    check({"x.tif": seeds.rasters()[name]}, "x.tif", command)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANNED)
def test_a_file_of_regions(check: Check, name: str) -> None:
    names = PARTS if name in PARTS else (name,)
    files = {part: seeds.vectors()[part] for part in names}
    check(files, name, ("plan", names[0], *FLIGHT))


@pytest.mark.slow
def test_a_block_map(check: Check) -> None:
    command = ("extract", "b.tif", "--range", "0.4,1", "-o", "out.geojson", "--threads", "1")
    check(dict(seeds.block_map()), "b.tif", command)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["m.yaml", "m.pgm"])
def test_a_ros_map(check: Check, name: str) -> None:
    check(dict(seeds.ros_maps()), name, ("classify", "m.yaml", "-o", "out.tif", "--threads", "1"))


@pytest.mark.slow
def test_a_scene(check: Check) -> None:
    check({"s.json": seeds.SCENE}, "s.json", ("simulate", "s.json", "-o", "out.tif"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("option", "name"), [("--mission", "a.plan"), ("--mission", "a.waypoints"), ("--path", "p.geojson")]
)
def test_what_is_drawn(check: Check, option: str, name: str) -> None:
    files = {part: seeds.missions()[part] for part in (name, "x.tif")}
    check(files, name, ("preview", "x.tif", option, name, "-o", "out.png", "--width", "300"))
