"""File of a web map: checked before the work, written after it."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, UavsegError
from uavseg.jobs.result.metadata import same_reading
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.jobs.source.open_source import open_source
from uavseg.jobs.source.source import Raster, Source
from uavseg.jobs.web_map.content import FieldMap
from uavseg.options.reading import ReadOptions
from uavseg.output.atomic import atomic_file, check_target
from uavseg.plot.web.field_map import other_intensity, page_of, read_collection, read_flights, size_notes
from uavseg.regions.formats.metadata import METADATA_KEY


@dataclass(frozen=True)
class PageFile:
    """Target of a page, with what is shown over the raster."""

    path: Path
    overwrite: bool
    regions: dict[str, Any] | None  # a GeoJSON FeatureCollection
    flights: list[dict[str, Any]]  # see `read_flights`
    camera: Any = None  # for footprints

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
        """Check that the page may be written, and read what is shown; call it before the work.

        `source` are rasters, which the page must not replace.
        """
        if Path(output).suffix.lower() not in {".html", ".htm"}:
            raise OutputError(
                f"a map is an HTML file: expected a name that ends in .html, got {Path(output).name!r}"
            )
        target = check_target(output, overwrite)
        keep_inputs([target], [source, regions, missions, camera])
        collection = None if regions is None else read_collection(regions)
        flights = [] if missions is None else read_flights(missions, camera)
        return cls(path=target, overwrite=overwrite, regions=collection, flights=flights, camera=camera)

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
        content = page_of(field_map, self.regions, self.flights)
        with atomic_file(self.path, self.overwrite) as temporary:
            temporary.write_bytes(content)
        other = other_intensity(self.regions, field_map.info)
        notes = [*([other] if other else []), *_footprint_notes(self.flights, self.camera)]
        return len(content), (*field_map.warnings, *notes, *size_notes(content))


def _footprint_notes(flights: Sequence[dict[str, Any]], camera: Any) -> list[str]:
    """Return the reasons why footprints are not shown, where a camera was named for them."""
    if camera is None:
        return []
    if not flights:
        return ["the camera is for footprints of photographs; name a mission too"]
    return [f"{flight['name']}: {flight['unseen']}" for flight in flights if flight["unseen"]]
