"""Photographs that came back from a flight."""

from __future__ import annotations

import os
from collections.abc import Sequence

from uavseg.access import Folders, allowing
from uavseg.api._values import job_function, progress_of, warn
from uavseg.arguments import checked
from uavseg.arrays import GeoDataFrame
from uavseg.execution.executors import Progress
from uavseg.flight.camera.camera import Camera
from uavseg.jobs.flights.photographs import (
    Georeferenced,
    footprints as run_footprints,
    georeference as run_georeference,
)
from uavseg.options.missions import FootprintsOptions, GeoreferenceOptions
from uavseg.options.option import build


@checked
def footprints(
    photographs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    dem: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None,
    home: Sequence[float] | None = None,
    camera: str | os.PathLike[str] | Camera | None = None,
    progress: Progress | bool | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> GeoDataFrame:
    """Return the ground that each photograph of a flight shows.

    Parameters
    ----------
    photographs : path or sequence of paths
        JPEG or TIFF files with EXIF or XMP tags, or folders of them with their subfolders.
    dem : path or sequence of paths, optional
        Elevation model of the ground, several files are one mosaic; by default it is flat, at the height of
        takeoff.
    home : (lat, lon) or (lat, lon, altitude_m), optional
        Place of takeoff in degrees, and its height above the sea in metres. Over an elevation model, heights
        are then those above takeoff, not altitudes.
    camera : str, path or Camera, optional
        Camera of all photographs, by its name in the catalogue or a JSON file; by default the focal length is
        that in the files.
    progress : callable or bool, optional
        Called with (done, total); True for a bar.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    footprints : GeoDataFrame
        Polygons in WGS 84 in the order of time, then of name, with `id`, `area_m2`, `photo` (name of the
        file), `camera_lon`, `camera_lat`, `height_m` (above the ground below), `yaw` and `pitch` of the line
        of sight in degrees, `gsd_cm` (ground sampling distance in the middle of the image), `taken` (time of
        the camera's clock as ISO 8601 text) and `lon`, `lat` of a point inside. What was assumed, and which
        photographs are left out and why, are warnings.

    Raises
    ------
    PhotographError
        If a file or a folder cannot be read, or no photograph can be placed.
    UavsegError
        If the elevation model cannot be read, or a parameter is wrong.
    """
    options = build(FootprintsOptions, locals())
    with allowing(allow_path, allow_network):
        found = run_footprints(photographs, options, progress_of(progress))
    warn(found.warnings)
    return found.regions.frame()


@job_function
def georeference(
    photographs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    resolution: float | None = None,
    dem: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None,
    home: Sequence[float] | None = None,
    camera: str | os.PathLike[str] | Camera | None = None,
    overwrite: bool = False,
    progress: Progress | bool | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Georeferenced:
    """Make a map of photographs by their pose alone, without photogrammetry.

    Each pixel of the map is of the photograph whose camera is nearest, interpolated between four of its
    pixels; nothing is blended. Ground behind other ground of the elevation model is left empty, and so is
    ground near the horizon, where it is seen 4 times as coarse as in the middle of the photograph. Lenses are
    taken to be without distortion.

    Parameters
    ----------
    photographs, dem, home, camera, progress, allow_path, allow_network
        As of `footprints`. The photographs have the same bands, of 8 or 16 bits.
    output : path
        The map, .tif: their bands and an alpha band, in the UTM zone of the place, north up. The likely error
        is among its tags.
    resolution : float, optional
        Side of a pixel in centimetres; by default the median of the ground sampling distance in the middle of
        the photographs.
    overwrite : bool
        Whether a map that is there may be replaced.

    Returns
    -------
    map : Georeferenced
        `path`, `geobox`, names of the `photographs` that are drawn, and the likely error in metres: in the
        middle of a photograph (`error_m`, the median), and where it is largest (`edge_error_m`). These are
        standard deviations of horizontal places, which follow from those of position, height and angles; what
        hills do to flat ground is not in them. What was assumed and left out are warnings.

    Raises
    ------
    PhotographError
        If a file cannot be read, no photograph can be placed, they differ in bands or type, or the map would
        be too large.
    UavsegError
        If the elevation model cannot be read, a parameter is wrong, or the map may not be written.
    """
    return run_georeference(photographs, build(GeoreferenceOptions, locals()), progress_of(progress))
