"""Map for the field: a raster with regions and missions as one HTML file that needs no network."""

import base64
import json
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.camera.photos import Photos
from uavseg.jobs.flights.request import photos_of
from uavseg.jobs.web_map.content import FieldMap
from uavseg.options.flights import PhotoOptions
from uavseg.plain_text import printable
from uavseg.plot.layers.mission_layer import read_missions
from uavseg.plot.page.map_furniture import length_text
from uavseg.plot.web.page import data_url, render_page
from uavseg.plot.web.region_features import first_range
from uavseg.raster.geodesy.globe import MAX_DECIMALS, crs_name, decimals_for

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission

LARGE_BYTES = 10 << 20
_DECIMALS = 7  # of degrees: a centimetre


def page_of(
    found: FieldMap,
    regions: dict[str, Any] | None,
    missions: Sequence[dict[str, Any]],
    server: dict[str, Any] | None = None,
) -> bytes:
    """The content of the HTML file.

    Parameters
    ----------
    found : FieldMap
    regions : dict, optional
        A GeoJSON FeatureCollection in WGS 84, see `region_features`.
    missions : sequence of dict
        See `read_flights`.
    server : dict, optional
        What a server offers, for a page that asks one.
    """
    data = data_of(found, regions, missions) | {"server": server}
    return render_page(title_of(found), data, served=server is not None)


def title_of(found: FieldMap) -> str:
    """The title of the page."""
    return printable(found.info.name)


def data_of(
    found: FieldMap, regions: dict[str, Any] | None, missions: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """What the page's program reads; parameters as of `page_of`."""
    return {
        "title": title_of(found),
        "about": _about(found),
        "notes": [printable(note) for note in found.warnings],
        "image": {"url": data_url(found.image.webp, "image/webp"), "bounds": found.image.bounds},
        "cells": _cells(found) if found.fits_page else None,
        "range": first_range(regions, found.info),
        "regions": regions,
        "missions": list(missions),
        "server": None,
    }


def size_notes(content: bytes) -> list[str]:
    """A note where a page is large for a telephone."""
    if len(content) <= LARGE_BYTES:
        return []
    return [
        f"the page has {len(content) / 1e6:.0f} MB, which is slow on a telephone: a smaller --size, or fewer "
        "or simplified regions make it smaller"
    ]


def read_flights(missions: Any, camera: Any = None) -> list[dict[str, Any]]:
    """Missions or mission files as values of JSON: features, path with numbers, estimates and warnings.

    Parameters
    ----------
    missions : Mission, path or sequence of these
    camera : str, path or Camera, optional
        What photographs, for footprints; by default the missions' own, which files do not hold.

    Raises
    ------
    MissionError
        If a file cannot be read.
    ParameterError
        If the camera is not known.
    """
    photos = photos_of(PhotoOptions(camera=camera))
    return [_flight(printable(name), mission, photos) for name, mission in read_missions(missions)]


def _flight(name: str, mission: "Mission", photos: Photos | None) -> dict[str, Any]:
    from uavseg.flight.formats.geojson import write_geojson
    from uavseg.flight.formats.options import FileOptions
    from uavseg.flight.mission.estimate import estimate_text, footprints
    from uavseg.flight.mission.items import LANDINGS, RETURN, TAKEOFFS

    lat, lon, _ = mission.path
    aside, number, numbers = {*TAKEOFFS, RETURN, *LANDINGS}, 0, [0]
    for item in mission.items:
        if item.has_position or item.command == RETURN:
            counts = item.command not in aside
            number += counts
            numbers.append(number if counts else 0)
    estimate, shown = mission.estimate, footprints(mission, photos)
    flown = estimate_text(estimate.distance_m, estimate.duration_s)
    shots = f", {estimate.photographs:,} photographs" if estimate.photographs else ""
    return {
        "name": name,
        "estimate": f"{len(mission.items)} items, {flown}{shots}",
        "notes": [printable(note) for note in mission.warnings],
        "path": [[round(float(y), 8), round(float(x), 8)] for y, x in zip(lat, lon, strict=True)],
        "numbers": numbers,
        "footprints": np.round(shown.lonlat, _DECIMALS).tolist(),
        "unseen": shown.note,
        "features": json.loads(write_geojson(mission, FileOptions())),
    }


def _about(found: FieldMap) -> str:
    """Size, CRS and stretch of the raster, and what a pixel of the picture shows."""
    rows, cols = found.info.geobox.shape
    shown = found.image.shape
    side = (rows * cols / (shown[0] * shown[1]) * float(found.ground.pixel_m2.mean())) ** 0.5
    parts = [
        f"{cols} x {rows} pixels",
        str(crs_name(found.info.geobox.wkt)),
        f"picture of {shown[1]} x {shown[0]} pixels of about {length_text(float(f'{side:.3g}'), 'm')}",
        found.info.band_names,
        f"v: {found.info.stretch.name}",
    ]
    return printable(" · ".join(parts))


def _cells(found: FieldMap) -> dict[str, Any]:
    cells, ground = found.cells, found.ground
    assert cells is not None
    return {
        "shape": cells.shape,
        "cells": cells.codes.shape,
        "codes": _packed(cells.codes.astype("<u2")),
        "counts": _packed(cells.counts),
        "ground": {
            "shape": ground.lon.shape,
            "lon": [round(value, MAX_DECIMALS) for value in ground.lon.ravel().tolist()],
            "lat": [round(value, MAX_DECIMALS) for value in ground.lat.ravel().tolist()],
            "pixel_m2": [float(f"{value:.10g}") for value in ground.pixel_m2.ravel().tolist()],
            "decimals": decimals_for(float(np.sqrt(ground.pixel_m2.min()))),
        },
    }


def _packed(values: NDArray[Any]) -> str:
    return base64.b64encode(zlib.compress(values.tobytes(), 9)).decode()
