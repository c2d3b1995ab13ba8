"""Web map: a raster, regions as GeoJSON and missions in one HTML page that needs no network, and its file."""

import base64
import hashlib
import html
import io
import json
import math
import os
import zlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from string import Template
from typing import Any
from urllib.parse import quote

import numpy as np
import shapely

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, UavsegError
from uavseg.flight.camera.camera import Photos
from uavseg.flight.formats.files import write_geojson
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission.estimate import estimate_text, footprints
from uavseg.flight.mission.mission import Mission
from uavseg.jobs.flights.request import open_regions, photos_of
from uavseg.jobs.result.result import SourceInfo, same_reading
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.jobs.source.open_source import open_source
from uavseg.jobs.source.source import Raster, Source
from uavseg.jobs.web_map.content import STEPS, FieldMap
from uavseg.options.flights import PhotoOptions
from uavseg.options.reading import ReadOptions
from uavseg.output.atomic import atomic_file, check_target, transaction
from uavseg.plain_text import printable
from uavseg.plot.layers.mission_layer import path_numbers, read_missions
from uavseg.plot.page.page import length_text
from uavseg.raster.geodesy.globe import MAX_DECIMALS, crs_name, decimals_for
from uavseg.regions.formats.metadata import METADATA_KEY, about_file

Json = dict[str, Any]
DEFAULT_RANGE = (550, 1000)  # in steps of the slider
_PLAIN_BYTES, _LARGE_BYTES = 1 << 20, 10 << 20  # of regions as they are, of a page without a warning
_FOOTPRINT_DECIMALS, _REGION_DECIMALS = 7, 9  # of degrees: a centimetre, a tenth of a millimetre
_ICON = 192  # pixels along each side
_ASSETS = Path(__file__).parent / "assets"
_PROGRAM = (
    *("blocks.js", "outlines.js", "elements.js", "regions.js", "cells.js", "slider.js", "missions.js"),
    *("position.js", "app.js"),
)
_SERVED = ("asking.js", "drawing.js", "code_tiles.js", "served.js")  # before app.js
_MAPPED = "//# sourceMappingURL"


def render_page(
    title: str, data: dict[str, Any], served: bool = False, embedded: bool = False, manifest: str = ""
) -> bytes:
    """Render the content of an HTML file with data for its program, values of JSON.

    The page has a Content-Security-Policy that allows nothing but its own script and style, by their hashes,
    workers that this script makes, and images within the file: content of data can neither run nor load
    anything. A `served` page may send requests to its server, and no other; an `embedded` one exchanges its
    range with the window that frames it. One with a `manifest`, a file beside it, may be kept by a service
    worker beside it too.
    """
    script, style = _script(served, embedded), _style()
    sources = "img-src data: 'self'; connect-src 'self'" if served else "img-src data:"
    policy = (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; "
        f"worker-src blob:; {sources}; base-uri 'none'; form-action 'none'"
    )
    if manifest:
        policy = policy.replace("worker-src", "manifest-src 'self'; worker-src 'self'")
    link = '<link rel="icon" href="data:,">' if served else ""  # or the browser asks for one
    # JSON without a character that ends a script element or begins a comment in one
    encoded = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    encoded = encoded.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    page = Template(asset("page.html")).substitute(
        policy=policy,
        title=html.escape(title),
        link=f'<link rel="manifest" href="{quote(manifest)}">' if manifest else link,
        licence=asset("leaflet/LICENSE").replace("--", "- -"),
        style=style,
        data=encoded,
        script=script,
    )
    return page.encode()


def data_url(content: bytes, media_type: str) -> str:
    """Encode a file as a URL that holds it."""
    return f"data:{media_type};base64,{base64.b64encode(content).decode()}"


@cache
def _script(served: bool, embedded: bool) -> str:
    library = asset("leaflet/leaflet.js")
    programs = [*_PROGRAM[:-1], *_SERVED * served, _PROGRAM[-1], *["embed.js"] * embedded]
    return "\n".join([library[: library.rindex(_MAPPED)], *map(asset, programs)])


@cache
def _style() -> str:
    style = asset("leaflet/leaflet.css").replace("url(images/marker-icon.png)", "none")
    for name in ("layers.png", "layers-2x.png"):
        url = data_url((_ASSETS / "leaflet" / name).read_bytes(), "image/png")
        style = style.replace(f"url(images/{name})", f"url({url})")
    return f"{style}\n{asset('page.css')}"


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def asset(name: str) -> str:
    """Read the text of a file of `assets`."""
    return (_ASSETS / name).read_text(encoding="utf-8").replace("\r\n", "\n")


def page_of(
    field_map: FieldMap,
    regions: Json | None,
    missions: Sequence[Json],
    server: Json | None = None,
    beside: Sequence[Path] = (),
) -> bytes:
    """Render a map as HTML, with regions and missions as read here; `server` is what a server offers.

    The service worker and the manifest of an installable page are the files `beside` it.
    """
    keeper, manifest = [path.name for path in beside] or ["", ""]
    data = data_of(field_map, regions, missions) | {"server": server, "keeper": quote(keeper) or None}
    return render_page(title_of(field_map), data, served=server is not None, manifest=manifest)


def _installing(page: str, manifest_name: str, field_map: FieldMap) -> list[bytes]:
    """Return the service worker and the manifest of a page, with the picture as its icon."""
    from PIL import Image, ImageOps

    icon, address = io.BytesIO(), quote(page)
    with Image.open(io.BytesIO(field_map.image.webp)) as image:
        ImageOps.fit(image.convert("RGB"), (_ICON, _ICON)).save(icon, "PNG")
    worker = Template(asset("keep.js")).safe_substitute(page=address, manifest=quote(manifest_name))
    shown = {"src": data_url(icon.getvalue(), "image/png"), "sizes": f"{_ICON}x{_ICON}", "type": "image/png"}
    title, places = title_of(field_map), {"start_url": address, "scope": address}
    manifest = {"name": title, "short_name": title, **places, "display": "standalone", "icons": [shown]}
    return [worker.encode(), json.dumps(manifest, indent=2).encode()]


def title_of(field_map: FieldMap) -> str:
    """Return the title of the page."""
    return printable(field_map.info.name)


def data_of(field_map: FieldMap, regions: Json | None, missions: Sequence[Json]) -> Json:
    """Return the data for the page's program, values of JSON, large regions packed; see `page_of`."""
    text = json.dumps(regions, allow_nan=False, separators=(",", ":")).encode()
    return {
        "title": title_of(field_map),
        "about": _about(field_map),
        "notes": [printable(note) for note in field_map.warnings],
        "image": {"url": data_url(field_map.image.webp, "image/webp"), "bounds": field_map.image.bounds},
        "cells": _cells(field_map) if field_map.fits_page else None,
        "range": first_range(regions, field_map.info),
        "regions": regions if len(text) < _PLAIN_BYTES else {"packed": _packed(text, 6)},
        "missions": list(missions),
        "server": None,
        "keeper": None,
    }


def size_notes(content: bytes) -> list[str]:
    """Return a warning where a page is large for a telephone."""
    if len(content) <= _LARGE_BYTES:
        return []
    return [
        f"the page has {len(content) / 1e6:.0f} MB, slow on a telephone: a smaller --size, and regions "
        "extracted with --min-area and --simplify make it smaller, uavseg serve needs no file"
    ]


def read_flights(missions: Any, camera: Any = None) -> list[dict[str, Any]]:
    """Convert missions or their files to values of JSON; the camera of footprints is by default their own."""
    photos = photos_of(PhotoOptions(camera=camera))
    return [_flight(printable(name), mission, photos) for name, mission in read_missions(missions)]


def _flight(name: str, mission: Mission, photos: Photos | None) -> dict[str, Any]:
    lat, lon, _ = mission.path
    estimate, shown = mission.estimate, footprints(mission, photos)
    flown = estimate_text(estimate.distance_m, estimate.duration_s)
    shots = f", {estimate.photographs:,} photographs" if estimate.photographs else ""
    return {
        "name": name,
        "estimate": f"{len(mission.items)} items, {flown}{shots}",
        "notes": [printable(note) for note in mission.warnings],
        "path": [[round(float(y), 8), round(float(x), 8)] for y, x in zip(lat, lon, strict=True)],
        "numbers": path_numbers(mission)[0].tolist(),
        "footprints": np.round(shown.lonlat, _FOOTPRINT_DECIMALS).tolist(),
        "unseen": shown.note,
        "features": json.loads(write_geojson(mission, FileOptions())),
    }


def _about(field_map: FieldMap) -> str:
    """Describe the raster: its size, CRS and stretch, and the size of a pixel of the picture."""
    rows, cols = field_map.info.geobox.shape
    shown = field_map.image.shape
    side = (rows * cols / (shown[0] * shown[1]) * float(field_map.ground.pixel_m2.mean())) ** 0.5
    parts = [
        f"{cols} x {rows} pixels",
        str(crs_name(field_map.info.geobox.wkt)),
        f"picture of {shown[1]} x {shown[0]} pixels of about {length_text(float(f'{side:.3g}'), 'm')}",
        field_map.info.band_names,
        f"v: {field_map.info.stretch.name}",
    ]
    return printable(" · ".join(parts))


def _cells(field_map: FieldMap) -> dict[str, Any]:
    cells, ground = field_map.cells, field_map.ground
    assert cells is not None
    return {
        "shape": cells.shape,
        "cells": cells.codes.shape,
        "codes": _packed(cells.codes.astype("<u2").tobytes()),
        "counts": _packed(cells.counts.tobytes()),
        "ground": {
            "shape": ground.lon.shape,
            "lon": [round(value, MAX_DECIMALS) for value in ground.lon.ravel().tolist()],
            "lat": [round(value, MAX_DECIMALS) for value in ground.lat.ravel().tolist()],
            "pixel_m2": [float(f"{value:.10g}") for value in ground.pixel_m2.ravel().tolist()],
            "decimals": decimals_for(float(np.sqrt(ground.pixel_m2.min()))),
        },
    }


def _packed(values: bytes, level: int = 9) -> str:
    return base64.b64encode(zlib.compress(values, level)).decode()


def read_collection(regions: Any) -> dict[str, Any]:
    """Convert regions of a file or GeoDataFrame to GeoJSON features in WGS 84, with their metadata."""
    table = open_regions(regions)
    columns = {name: list(map(_value, np.asarray(column).tolist())) for name, column in table.columns.items()}
    oriented = shapely.orient_polygons(table.polygons)
    features = []
    for n, polygon in enumerate(shapely.transform(oriented, lambda xy: xy.round(_REGION_DECIMALS))):
        properties = {name: values[n] for name, values in columns.items()}
        features.append({"type": "Feature", "properties": properties, "geometry": polygon.__geo_interface__})
    is_path = isinstance(regions, str | os.PathLike)
    made = about_file(regions).metadata if is_path else regions.attrs.get(METADATA_KEY)
    return {"type": "FeatureCollection", **({METADATA_KEY: made} if made else {}), "features": features}


def other_intensity(collection: dict[str, Any] | None, info: SourceInfo) -> str | None:
    """Return a warning where regions were made from another intensity than a page shows."""
    made = (collection or {}).get(METADATA_KEY, {})
    stretch = info.stretch
    theirs = made.get("band"), made.get("stretch_low"), made.get("stretch_high")
    if None in theirs or theirs == (info.band_names, stretch.low, stretch.high):
        return None
    return (
        f"the regions were made from {made['band']}, stretch {made.get('stretch')}; the slider shows "
        f"{info.band_names}, stretch {stretch.name}, where their range means something else"
    )


def first_range(collection: dict[str, Any] | None, info: SourceInfo) -> tuple[int, int]:
    """Return the slider's first range in steps: that of all regions, if of the intensity that is shown."""
    if other_intensity(collection, info):
        return DEFAULT_RANGE
    features = [] if collection is None else collection["features"]
    ranges = {tuple(one["properties"].get(name) for name in ("range_low", "range_high")) for one in features}
    ends = ranges.pop() if len(ranges) == 1 else (None, None)
    if not all(isinstance(end, float | int) and 0 <= end <= 1 for end in ends):
        return DEFAULT_RANGE
    low, high = (round(end * STEPS) for end in ends)
    low = min(low, STEPS - 1)
    return low, max(high, low + 1)  # the ends of the slider are never the same


def _value(value: Any) -> Any:
    """Convert a value to one of JSON: floats with up to twelve significant digits, other types to text."""
    if isinstance(value, float):
        return float(f"{value:.12g}") if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


@dataclass(frozen=True)
class PageFile:
    """Target of a page, with what is shown over the raster."""

    path: Path
    overwrite: bool
    regions: dict[str, Any] | None  # a GeoJSON FeatureCollection
    flights: list[dict[str, Any]]  # see `read_flights`
    camera: Any = None  # for footprints
    beside: tuple[Path, ...] = ()  # the service worker and the manifest of an installable page

    @classmethod
    def prepared(
        cls,
        output: Path_,
        overwrite: bool,
        source: Any,
        regions: Any = None,
        missions: Any = None,
        camera: Any = None,
        installable: bool = False,
    ) -> "PageFile":
        """Check that the page may be written, and read what is shown; call it before the work.

        `source` are rasters, which the page must not replace.
        """
        if Path(output).suffix.lower() not in {".html", ".htm"}:
            why = "a map is an HTML file: expected a name that ends in .html"
            raise OutputError(f"{why}, got {Path(output).name!r}")
        names = [Path(output).with_suffix(ending) for ending in [".sw.js", ".webmanifest"] * installable]
        target, *beside = (check_target(path, overwrite) for path in (output, *names))
        keep_inputs([target, *beside], [source, regions, missions, camera])
        collection = None if regions is None else read_collection(regions)
        flights = [] if missions is None else read_flights(missions, camera)
        shown = {"regions": collection, "flights": flights, "camera": camera}
        return cls(path=target, overwrite=overwrite, beside=tuple(beside), **shown)

    def open_source(self, source: Any, options: ReadOptions) -> Source:
        """Open the raster of the page, in the intensity of its regions where no other one is chosen."""
        raster = open_source(source, options)
        made = (self.regions or {}).get(METADATA_KEY, {})
        if options.chooses_pixels or options.stretches("auto") or not isinstance(raster, Raster):
            return raster
        options_of_regions = same_reading(made, raster)
        if options_of_regions is None:
            return raster
        try:
            reopened = open_source(source, options_of_regions)
        except UavsegError:  # the raster has changed since; `write` warns that its intensity differs
            return raster
        is_same = isinstance(reopened, Raster) and reopened.dataset.band_names == made["band"]
        return reopened if is_same else raster

    def write(self, field_map: FieldMap) -> tuple[int, tuple[str, ...]]:
        """Write the page, whole or not at all, and return its size in bytes and warnings."""
        content = page_of(field_map, self.regions, self.flights, beside=self.beside)
        more = _installing(self.path.name, self.beside[1].name, field_map) if self.beside else []
        with transaction():
            for path, written in zip((self.path, *self.beside), (content, *more), strict=True):
                with atomic_file(path, self.overwrite) as temporary:
                    temporary.write_bytes(written)
        other = other_intensity(self.regions, field_map.info)
        notes = [other] if other else []
        if self.camera is not None and not self.flights:
            notes.append("the camera is for footprints of photographs; name a mission too")
        elif self.camera is not None:
            notes += [f"{flight['name']}: {flight['unseen']}" for flight in self.flights if flight["unseen"]]
        return len(content), (*field_map.warnings, *notes, *size_notes(content))
