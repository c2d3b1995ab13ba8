"""Files that end early, as where reading fails: one clear line at whatever byte they end, or a whole result."""

from collections.abc import Iterator

import pytest

from tests.hostile import campaign, seeds
from tests.hostile.case import Case
from tests.hostile.judging import judge
from tests.hostile.sandbox import Sandbox

LENGTHS = 40  # of each file
FLIGHT = ("-o", "out.plan", "--altitude", "50", "--home", "auto")
PLANNED = ("r.geojson", "r.gpkg", "r.fgb", "r.parquet", "r.shp", "r.shx", "r.dbf", "r.prj", "r.kml", "r.csv")
PARTS = ("r.shp", "r.shx", "r.dbf", "r.prj", "r.cpg")


@pytest.fixture(scope="module")
def sandbox() -> Iterator[Sandbox]:
    campaign.prepare()
    sandbox = Sandbox()
    yield sandbox
    sandbox.close()


def check(sandbox: Sandbox, files: dict[str, bytes], name: str, command: tuple[str, ...]) -> None:
    """Run a command with a file cut off at many lengths."""
    content = files[name]
    found = {}
    for n in range(LENGTHS):
        length = n * len(content) // LENGTHS
        case = Case(files | {name: content[:length]}, (command,))
        found[length] = judge(case, sandbox.run(case))
    assert not any(found.values()), {length: what for length, what in found.items() if what}


@pytest.mark.slow
@pytest.mark.parametrize("name", seeds.rasters())
def test_a_raster(sandbox: Sandbox, name: str) -> None:
    command = ("extract", "x.tif", "--range", "0.4,1", "-o", "out.gpkg", "--threads", "1")
    check(sandbox, {"x.tif": seeds.rasters()[name]}, "x.tif", command)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANNED)
def test_a_file_of_regions(sandbox: Sandbox, name: str) -> None:
    names = PARTS if name in PARTS else (name,)
    files = {part: seeds.vectors()[part] for part in names}
    check(sandbox, files, name, ("plan", names[0], *FLIGHT))


@pytest.mark.slow
def test_a_block_map(sandbox: Sandbox) -> None:
    command = ("extract", "b.tif", "--range", "0.4,1", "-o", "out.geojson", "--threads", "1")
    check(sandbox, dict(seeds.block_map()), "b.tif", command)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["m.yaml", "m.pgm"])
def test_a_ros_map(sandbox: Sandbox, name: str) -> None:
    check(sandbox, dict(seeds.ros_maps()), name, ("classify", "m.yaml", "-o", "out.tif", "--threads", "1"))


@pytest.mark.slow
def test_a_scene(sandbox: Sandbox) -> None:
    check(sandbox, {"s.json": seeds.SCENE}, "s.json", ("simulate", "s.json", "-o", "out.tif"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("option", "name"), [("--mission", "a.plan"), ("--mission", "a.waypoints"), ("--path", "p.geojson")]
)
def test_what_is_drawn(sandbox: Sandbox, option: str, name: str) -> None:
    files = {part: seeds.missions()[part] for part in (name, "x.tif")}
    check(sandbox, files, name, ("preview", "x.tif", option, name, "-o", "out.png", "--width", "300"))
