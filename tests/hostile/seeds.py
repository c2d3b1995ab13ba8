"""Seeds: small valid files of every kind that is read, drawn once for a campaign."""

import json
import math
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray

Files = dict[str, bytes]
_drawn: dict[str, Files] = {}
UTM = {"crs": "EPSG:32633", "transform": Affine(1, 0, 500000, 0, -1, 4500000)}
TILED = {"tiled": True, "blockxsize": 64, "blockysize": 64}


def once(draw: Callable[[], Files]) -> Callable[[], Files]:
    """Draw when first asked for; a process that was given the seeds draws none."""

    def drawn() -> Files:
        if draw.__name__ not in _drawn:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of rasterio, about rasters without a place
                _drawn[draw.__name__] = draw()
        return _drawn[draw.__name__]

    return drawn


def everything() -> dict[str, Files]:
    """All seeds, for `use` in other processes."""
    from tests.hostile.format_seeds import formats

    for draw in (rasters, formats, vectors, block_map, missions, ros_maps, bags, photographs, kept_results):
        draw()
    return _drawn


def use(drawn: dict[str, Files]) -> None:
    """Take seeds that another process drew."""
    _drawn.update(drawn)


def image(rows: int, cols: int, seed: int = 0) -> NDArray[np.uint8]:
    """Two textures and a gradient with a bright patch."""
    rng = np.random.default_rng(seed)
    grey = np.add.outer(np.arange(rows), np.arange(cols)) % 97 + rng.integers(0, 30, (rows, cols))
    grey[rows // 4 : rows // 2, cols // 3 : cols // 2] = 230
    grey[: rows // 6, : cols // 6] = 0
    return grey.astype(np.uint8)


def write_tif(folder: Path, name: str, values: NDArray[Any], **how: Any) -> None:
    bands = values if values.ndim == 3 else values[np.newaxis]
    how = {"driver": "GTiff", "height": bands.shape[1], "width": bands.shape[2], "count": len(bands)} | how
    with rasterio.open(folder / name, "w", dtype=bands.dtype.name, **how) as file:
        file.write(bands)


@once
def rasters() -> Files:
    """Rasters by name: layouts, types and compressions that GDAL's drivers decode differently."""
    grey = image(128, 140)
    small = image(50, 60)
    colours = np.stack([grey, np.roll(grey, 9, 0), 255 - grey])
    with TemporaryDirectory() as made:
        folder = Path(made)
        write_tif(folder, "deflate.tif", grey, compress="deflate", nodata=0, **TILED, **UTM)
        write_tif(folder, "lzw.tif", grey.astype(np.uint16) * 257, compress="lzw", **UTM)
        write_tif(
            folder,
            "jpeg.tif",
            colours,
            compress="jpeg",
            photometric="ycbcr",
            interleave="pixel",
            **TILED,
            **UTM,
        )
        write_tif(folder, "jpeg1.tif", grey, compress="jpeg", **TILED, **UTM)
        write_tif(folder, "lerc.tif", grey.astype(np.float32) / 255, compress="lerc", **UTM)
        write_tif(
            folder, "zstd.tif", (grey / 255.0), compress="zstd", predictor=3, nodata=np.nan, **TILED, **UTM
        )
        write_tif(folder, "int32.tif", grey.astype(np.int32) - 100, nodata=-100, blockysize=22, **UTM)
        write_tif(folder, "plain.tif", small)
        write_tif(
            folder, "degrees.tif", small, crs="EPSG:4326", transform=Affine(1e-4, 0, 15, 0, -1e-4, 40.6)
        )
        near = Affine(1e-5, 0, 15.0008, 0, -1e-5, 40.6507)  # on other pixels of the same ground
        write_tif(folder, "near.tif", small, crs="EPSG:4326", transform=near, nodata=0)
        write_tif(
            folder, "sparse.tif", np.zeros((200, 200), np.uint8), sparse_ok=True, nodata=0, **TILED, **UTM
        )
        write_tif(folder, "big.tif", small, bigtiff="YES", compress="packbits", **UTM)
        write_tif(
            folder,
            "alpha.tif",
            np.stack([*colours, grey // 2]),
            photometric="rgb",
            alpha="yes",
            compress="deflate",
            **TILED,
            **UTM,
        )
        write_tif(folder, "bits.tif", (grey > 90).astype(np.uint8), nbits=1, compress="packbits", **UTM)
        write_tif(folder, "palette.tif", small % 4, photometric="palette", **UTM)
        with rasterio.open(folder / "palette.tif", "r+") as file:
            file.write_colormap(1, {n: (60 * n, 255 - 60 * n, 10, 255) for n in range(4)})
        write_tif(folder, "points.tif", small, gcps=_control_points(), crs="EPSG:4326")
        with (
            rasterio.open(folder / "deflate.tif") as file,
            rasterio.open(folder / "overviews.tif", "w", **file.profile) as other,
        ):
            other.write(file.read())
            other.build_overviews([2, 4])
            other.write_mask(np.where(file.read(1) > 9, 255, 0).astype(np.uint8))
        write_tif(folder, "picture.png", grey, driver="PNG")
        write_tif(folder, "picture.jpg", grey, driver="JPEG")
        return {path.name: path.read_bytes() for path in sorted(folder.glob("*.*")) if path.suffix != ".xml"}


def _control_points() -> list[Any]:
    from rasterio.control import GroundControlPoint

    return [GroundControlPoint(r, c, 15 + c / 1e4, 40 - r / 1e4) for r, c in ((0, 0), (0, 60), (50, 0))]


@once
def vectors() -> Files:
    """Files of regions in every format that is read, with those that belong to them; `x.tif` is their raster."""
    with TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "x.tif").write_bytes(rasters()["deflate.tif"])
        commands = [
            f"extract x.tif --range 0.5,1 -o r.{suffix} --min-area 40px"
            for suffix in ("geojson", "gpkg", "fgb", "parquet", "shp", "kml")
        ]
        commands.append("levels x.tif --width 0.3 -o lv.geojson --min-area 80px")
        commands.append("extract x.tif --class dark=0,0.4 --class bright=0.4,1 -o cl.geojson --min-area 80px")
        _uavseg(folder, *commands)
        ring = "15.0000 40.6000,15.0003 40.6000,15.0003 40.6003,15.0000 40.6003,15.0000 40.6000"
        (folder / "r.csv").write_text(f'id,WKT\n1,"POLYGON (({ring}))"\n2,"POLYGON (({ring}))"\n')
        (folder / "hand.geojson").write_text(json.dumps(_hand_made()))
        (folder / "hand.kml").write_text(
            _KML.format(ring=" ".join(",".join(place.split()) + ",0" for place in ring.split(",")))
        )
        return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def _hand_made() -> dict[str, Any]:
    outer = [[15.0, 40.6], [15.001, 40.6], [15.001, 40.601], [15.0, 40.601], [15.0, 40.6]]
    hole = [[15.0002, 40.6002], [15.0004, 40.6002], [15.0004, 40.6004], [15.0002, 40.6002]]
    shapes = [("Polygon", [outer, hole]), ("MultiPolygon", [[outer], [[[x + 0.002, y] for x, y in outer]]])]
    return {
        "type": "FeatureCollection",
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}},
        "features": [
            {
                "type": "Feature",
                "properties": {"id": n, "name": "a field", "mean": 0.7, "area_m2": 9000.0, "level": n},
                "geometry": {"type": kind, "coordinates": coordinates},
            }
            for n, (kind, coordinates) in enumerate(shapes, start=1)
        ],
    }


_KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><name>fields</name><Placemark><name>one</name>
<Polygon><outerBoundaryIs><LinearRing><coordinates>{ring}</coordinates></LinearRing></outerBoundaryIs></Polygon>
</Placemark></Document></kml>
"""


@once
def block_map() -> Files:
    """A block map `b.tif` and the raster that it was made from, `x.tif`."""
    with TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "x.tif").write_bytes(rasters()["deflate.tif"])
        _uavseg(folder, "divide x.tif -o b.tif")
        return {name: (folder / name).read_bytes() for name in ("b.tif", "x.tif")}


@once
def missions() -> Files:
    """Missions, a path and states, over `x.tif` and the map `m.tif`."""
    with TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "x.tif").write_bytes(rasters()["deflate.tif"])
        (folder / "r.geojson").write_bytes(vectors()["r.geojson"])
        (folder / "s.json").write_bytes(SCENE)
        plan, lines = "plan r.geojson --altitude 50 --home auto", "--spacing 12"
        _uavseg(
            folder,
            "simulate s.json -o m.tif",
            "classify m.tif -o st.tif",
            *(f"{plan} -o a.{suffix}" for suffix in ("plan", "waypoints")),
            *(f"{plan} -o a.{suffix} {lines}" for suffix in ("kml", "geojson", "kmz", "csv")),
            f"{plan} -o e.plan {lines} --editable",
            "path x.tif --range 0,0.9 --start 500005,4499920 --goal 500030,4499930 -o p.geojson",
        )
        return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@once
def photographs() -> Files:
    """Photographs of several makers, at the place of the rasters."""
    from tests.photographs.make import MAKERS, draw_photograph
    from uavseg.photographs.read import Photograph

    taken = Photograph(
        path="", lon=15.0008, lat=40.6502, relative_m=50, altitude_m=200, yaw_deg=20, pitch_deg=-80,
        image_px=(48, 36), focal_px=40.0, taken_s=1.7e9,
    )  # fmt: skip
    with TemporaryDirectory() as made:
        folder = Path(made)
        draw_photograph(folder / "p.jpg", taken)
        draw_photograph(folder / "p.tif", taken, maker="pix4d")
        for number, maker in enumerate(MAKERS):
            draw_photograph(folder / f"{number}.jpg", taken, maker=maker)
        return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@once
def ros_maps() -> Files:
    """ROS maps: `m.yaml` names one of three pictures."""
    grey = np.choose(image(40, 50) // 90, [np.uint8(0), np.uint8(205), np.uint8(254)])
    with TemporaryDirectory() as made:
        folder = Path(made)
        write_tif(
            folder, "m.png", np.stack([grey, np.where(grey == 205, 0, 255).astype(np.uint8)]), driver="PNG"
        )
        plain = " ".join(map(str, grey.ravel())).encode()
        return {
            "m.yaml": _YAML.encode(),
            "m.pgm": b"P5\n# drawn\n50 40\n255\n" + grey.tobytes(),
            "p.pgm": b"P2 50 40 255\n" + plain,
            "m.png": (folder / "m.png").read_bytes(),
        }


@once
def bags() -> Files:
    """Recorded bags: `a.bag` of ROS 1, `a.db3` and `a.mcap` of ROS 2."""
    from tests.occupancy.bags.write_bags import (
        MULTI_ECHO,
        POINT_CLOUD,
        Drive,
        Recorded,
        write_ros1,
        write_ros2,
    )

    def recorded(ros: int) -> list[Recorded]:
        drive = Drive(ros, 3)
        echoes, clouds = [], []
        for one, scan in zip(drive.recorded_scans(), drive.scans(), strict=True):
            points = [(2 * math.cos(a), 2 * math.sin(a), 0.5) for a in scan.angles]
            cloud = drive.point_cloud(points, one.time)
            echoes.append(Recorded("/echo", MULTI_ECHO, one.time, drive.multi_echo(one.message)))
            clouds.append(Recorded("/points", POINT_CLOUD, one.time, cloud))
        return drive.everything() + echoes + clouds

    with TemporaryDirectory() as made:
        folder = Path(made)
        return {
            "a.bag": write_ros1(folder / "a.bag", recorded(1), "BZ2").read_bytes(),
            "a.db3": (write_ros2(folder / "db3", recorded(2)) / "db3.db3").read_bytes(),
            "db3/metadata.yaml": (folder / "db3" / "metadata.yaml").read_bytes(),
            "a.mcap": (write_ros2(folder / "mcap", recorded(2), "MCAP") / "mcap.mcap").read_bytes(),
        }


_YAML = """image: m.pgm
mode: trinary
resolution: 0.05
origin: [-1.0, 2.5, 0.1]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
SCENE = json.dumps(
    {
        "map": {"rows": 60, "cols": 70, "cell": 0.05, "origin": [0, 0]},
        "polygons": [[[1.0, 1.0], [1.5, 1.0], [1.2, 1.4]]],
        "circles": [{"center": [2.2, 2.0], "radius": 0.3}],
        "sensor": {"sigma": 0.05, "range": 2.0, "fov": 60, "step": 2},
        "poses": [{"at": [0.2, 0.2], "heading": 45}],
    }
).encode()


@once
def kept_results() -> Files:
    """The folder `done` of results that `RESUMED` keeps."""
    with TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "x.tif").write_bytes(rasters()["deflate.tif"])
        _uavseg(folder, " ".join((*RESUMED[:-4], *RESUMED[-2:])))
        files = [path for path in sorted(folder.rglob("done/**/*")) if path.is_file()]
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}


RESUMED = ("extract", "x.tif", "--range", "0.4,1", "-o", "out.geojson", "--threads", "1", "--resume", "done")


def _uavseg(folder: Path, *commands: str) -> None:
    """Run commands; in a process of their own, so that this one starts no threads, which do not survive a fork."""
    lines = [
        [*words, *(["--threads", "1"] if words[0] in _TILED else [])] for words in map(str.split, commands)
    ]
    subprocess.run(
        [sys.executable, "-c", _RUN, json.dumps(lines)], cwd=folder, check=True, capture_output=True
    )


_RUN = """
import json, sys
from uavseg.cli import main
for line in json.loads(sys.argv[1]):
    main(line, standalone_mode=False)
"""
_TILED = ("extract", "levels", "divide", "classify", "path")
