"""What came back from a flight: time and memory of the commands, by number and size of photographs.

    python -m benchmarks.photographs

Squares are surveyed and photographs are drawn for all triggers, grey and with the tags of DJI; those of maps
have 20 megapixels, of one texture. Each command runs as a process of its own; flights are cut in the middle.
Beside it, `shapely.union_all` of the same footprints: what gaps cost at least.
"""

import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import geopandas
import numpy as np
import shapely

from benchmarks import table
from benchmarks.measure import cost
from tests.photographs.make import draw_photograph
from uavseg.flight.formats.files import read_mission
from uavseg.photographs.coverage import planned_photographs

SIDES_M = (150, 450)
SMALL, LARGE = ((80, 60), 60.0), ((5472, 3648), 3648.0)  # columns and rows, focal length in pixels
MAPS = (4, 12)  # photographs


def main() -> None:
    """Print the table."""
    rows = []
    with TemporaryDirectory() as folder:
        for row in measured(Path(folder)):
            print(*row, file=sys.stderr, flush=True)
            rows.append(row)
    print(table.rows(["command", "photographs", "wall s", "CPU s", "peak MB"], rows))


def measured(folder: Path) -> Iterator[list[str]]:
    """Rows of the table."""
    for side_m in SIDES_M:
        mission = survey(folder / f"survey{side_m}.plan", side_m)
        shots = draw(mission, folder / f"small{side_m}", SMALL)
        count, flown = f"{len(shots):,}", str(folder / f"small{side_m}")
        prints = folder / f"footprints{side_m}.gpkg"
        yield ["footprints", count, *run("footprints", flown, "-o", str(prints))]
        start = time.perf_counter()
        shapely.union_all(geopandas.read_file(prints, layer="regions").geometry.to_numpy())
        yield ["- shapely.union_all", count, f"{time.perf_counter() - start:.2f}", "", ""]
        yield ["check --photos", count, *run("check", str(mission), "--photos", flown)]
        middle = str(len(read_mission(mission).items) // 2)
        rest = str(folder / f"rest{side_m}.plan")
        yield ["resume", count, *run("resume", str(mission), "--from", middle, "-o", rest)]
    mission, ground = folder / f"survey{SIDES_M[0]}.plan", texture(folder / "ground.tif")
    for number in MAPS:
        shots = draw(mission, folder / f"large{number}", LARGE, number, ground)
        made = str(folder / f"map{number}.tif")
        yield [
            "georeference, 20 Mpx",
            f"{len(shots):,}",
            *run("georeference", str(folder / f"large{number}"), "-o", made),
        ]


def survey(mission: Path, side_m: float) -> Path:
    """Plan over a square, and return the mission."""
    east, north = side_m / 2 / (111_320 * np.cos(np.radians(47))), side_m / 2 / 111_195
    region = mission.with_suffix(".geojson")
    region.write_text(shapely.to_geojson(shapely.box(8.01 - east, 47.01 - north, 8.01 + east, 47.01 + north)))
    words = [
        "--home",
        "47.01,8.01",
        "--altitude",
        "60",
        "--camera",
        "DJI Phantom 4 Pro",
        "--max-items",
        "5000",
    ]
    run("plan", str(region), *words, "-o", str(mission))
    return mission


def draw(
    mission: Path,
    folder: Path,
    lens: tuple[tuple[int, int], float],
    number: int | None = None,
    ground: Path | None = None,
) -> list[Path]:
    """Draw the photographs of a mission, or the first ones, for a lens."""
    folder.mkdir()
    return [
        draw_photograph(folder / f"{k:05d}.jpg", replace(one, taken_s=1.7e9 + 2 * k), ground)
        for k, one in enumerate(planned_photographs(read_mission(mission), lens).photographs[:number])
    ]


def texture(path: Path) -> Path:
    """A raster of noise around the survey, of half a metre a pixel."""
    import rasterio

    values = np.random.default_rng(0).integers(0, 256, (1000, 1000)).astype(np.uint8)
    place = rasterio.Affine(6e-6, 0, 8.007, 0, -4.5e-6, 47.01225)
    how = {"driver": "GTiff", "count": 1, "height": 1000, "width": 1000, "dtype": "uint8", "crs": "EPSG:4326"}
    with rasterio.open(path, "w", transform=place, **how) as file:
        file.write(values, 1)
    return path


def run(*words: str) -> list[str]:
    """Wall and processor seconds and peak megabytes of a command."""
    spent = cost([sys.executable, "-m", "uavseg", *words, "-q"], os.environ)
    return [f"{spent.wall_s:.1f}", f"{spent.cpu_s:.1f}", f"{spent.peak_bytes / 1e6:.0f}"]


if __name__ == "__main__":
    main()
