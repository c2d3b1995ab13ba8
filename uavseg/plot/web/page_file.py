"""The file of a web map: checked before the work, written after it, with what its reader should know."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavseg.errors import OutputError, UavsegError
from uavseg.jobs.result.metadata import same_reading
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.jobs.source.open_source import open_source
from uavseg.jobs.source.source import Raster, Source
from uavseg.jobs.web_map.content import FieldMap
from uavseg.options.reading import ReadOptions
from uavseg.output.atomic import atomic_file, check_target
from uavseg.plot.web.field_map import page_of, read_flights, size_notes
from uavseg.plot.web.region_features import other_intensity, read_collection
from uavseg.regions.formats.metadata import METADATA_KEY


@dataclass(frozen=True)
class PageFile:
    """A page that may be made, with what is shown over the raster.

    Parameters
    ----------
    path : Path
    overwrite : bool
    regions : dict, optional
        A GeoJSON FeatureCollection.
    flights : list of dict
        See `read_flights`.
    camera : Any
        What was named for footprints, or None.
    """

    path: Path
    overwrite: bool
    regions: dict[str, Any] | None
    flights: list[dict[str, Any]]
    camera: Any = None

    @classmethod
    def prepared(
        cls,
        output: str | os.PathLike[str],
        overwrite: bool,
        source: Any,
        regions: Any = None,
        missions: Any = None,
        camera: Any = None,
    ) -> "PageFile":
        """Check that the page may be made, and read what is shown; call it before the work.

        Parameters
        ----------
        output : path
        overwrite : bool
            Whether a page that is there may be replaced.
        source : Any
            Rasters, which the page does not replace.
        regions : path or GeoDataFrame, optional
        missions : Mission, path or sequence of these, optional
        camera : str, path or Camera, optional

        Raises
        ------
        OutputError
            If the page may not be made.
        UavsegError
            If regions, missions or the camera cannot be read.
        """
        target = _checked_target(output, overwrite)
        keep_inputs([target], [source, regions, missions, camera])
        collection = None if regions is None else read_collection(regions)
        flights = [] if missions is None else read_flights(missions, camera)
        return cls(target, overwrite, collection, flights, camera)

    def open_source(self, source: Any, options: ReadOptions) -> Source:
        """Open the raster of the page: as its regions were read, where no other intensity is chosen.

        Raises
        ------
        UavsegError
            As of `open_source`.
        """
        raster = open_source(source, options)
        made = (self.regions or {}).get(METADATA_KEY, {})
        if options.chooses_pixels or options.stretches("auto") or not isinstance(raster, Raster):
            return raster
        alike = same_reading(made, raster)
        if alike is None:
            return raster
        try:
            found = open_source(source, alike)
        except UavsegError:  # the raster has changed since; `write` says that its intensity is another one
            return raster
        is_theirs = isinstance(found, Raster) and found.dataset.band_names == made["band"]
        return found if is_theirs else raster

    def write(self, found: FieldMap) -> tuple[int, tuple[str, ...]]:
        """Write the page, whole or not at all; returns its size in bytes, and warnings.

        Raises
        ------
        OutputError
            If the file exists, or cannot be written.
        """
        content = page_of(found, self.regions, self.flights)
        with atomic_file(self.path, self.overwrite) as temporary:
            temporary.write_bytes(content)
        other = other_intensity(self.regions, found.info)
        notes = [*([other] if other else []), *_footprint_notes(self.flights, self.camera)]
        return len(content), (*found.warnings, *notes, *size_notes(content))


def _checked_target(path: str | os.PathLike[str], overwrite: bool) -> Path:
    if Path(path).suffix.lower() not in {".html", ".htm"}:
        raise OutputError(
            f"a map is an HTML file: expected a name that ends in .html, got {Path(path).name!r}"
        )
    return check_target(path, overwrite)


def _footprint_notes(flights: Sequence[dict[str, Any]], camera: Any) -> list[str]:
    """Why footprints are not shown, where a camera was named for them."""
    if camera is None:
        return []
    if not flights:
        return ["the camera is for footprints of photographs; name a mission too"]
    return [f"{flight['name']}: {flight['unseen']}" for flight in flights if flight["unseen"]]
