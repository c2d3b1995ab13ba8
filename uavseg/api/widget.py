"""Widget for notebooks: a raster with a range slider, on the page of `uavseg map`.

>>> from uavseg import RangeWidget  # doctest: +SKIP
>>> widget = RangeWidget("tile.tif", (0.55, 1))  # doctest: +SKIP
>>> widget  # in a cell of its own; drag the slider  # doctest: +SKIP
>>> widget.regions()  # doctest: +SKIP
"""

import inspect
import math
import warnings
from typing import Any

from uavseg.access import allowing
from uavseg.api.rasters import extract
from uavseg.arrays import GeoDataFrame
from uavseg.errors import IntensityRangeError, MissingLibraryError, ParameterError
from uavseg.execution.executors import threads as thread_pool
from uavseg.jobs.source.open_source import open_source
from uavseg.jobs.source.work import Work
from uavseg.jobs.web_map.content import FieldMapRequest, field_map
from uavseg.options.option import build
from uavseg.options.pages import MapOptions
from uavseg.plot.web import field_map as web_page

try:
    import anywidget
    import traitlets
except ImportError as error:
    raise MissingLibraryError(
        f'the widget needs anywidget: pip install "uavseg[notebook]" ({error})'
    ) from error

STEPS = 1000  # of the slider
_MIN_HEIGHT, _MAX_HEIGHT = 200, 4000  # pixels
_OTHER_RANGES = ("values", "percentile", "classes")


class RangeWidget(anywidget.AnyWidget):  # type: ignore[misc]
    """A raster on a map with a slider of ranges, in a notebook.

    While the slider is dragged, the page shows regions of whole cells of 8 x 8 pixels, from the block map;
    `regions` are those of the same range to the pixel. It needs no network.

    Parameters
    ----------
    source : path, sequence of paths, DataArray, open raster of rasterio, or Dataset
        As of `uavseg.extract`, with a coordinate system.
    range : (float, float)
        Of v, in thousandths, the first below the second. Also an attribute, which follows the slider when it
        is let go, and moves it when it is set; `observe` reports changes.
    regions, mission : optional
        What else the map shows, as of `uavseg.map_page`.
    size : int
        Longest side of the picture of the raster in pixels, 64 to 8192.
    height : int
        Height of the widget in pixels, 200 to 4000.
    **words
        As of `uavseg.extract`, such as `band` and `min_area`. Those of reading and division are those of the
        page too.

    Raises
    ------
    UavsegError
        If the raster cannot be read or has no place on a map in Web Mercator, or a parameter is wrong.
    """

    _esm = web_page.asset("widget.js")
    page = traitlets.Unicode(read_only=True).tag(sync=True)
    range = traitlets.Tuple(traitlets.Float(), traitlets.Float()).tag(sync=True)
    height = traitlets.Int(600).tag(sync=True)

    def __init__(
        self,
        source: Any,
        range: tuple[float, float] = (0.55, 1.0),
        *,
        regions: Any = None,
        mission: Any = None,
        size: int = 2048,
        height: int = 600,
        **words: Any,
    ) -> None:
        self._source, self._words = source, words
        for name in _OTHER_RANGES:
            if words.get(name) is not None:
                raise ParameterError(f"the slider chooses the range in v; {name} is for uavseg.extract")
        bound = inspect.signature(extract).bind(source, None, **words)
        bound.apply_defaults()
        given = dict(bound.arguments)
        with allowing(given["allow_path"], given["allow_network"]):
            collection = None if regions is None else web_page.read_collection(regions)
            flights = [] if mission is None else web_page.read_flights(mission)
            options = build(MapOptions, given | {"size": size})
            request = FieldMapRequest(options.division.segment_params(), size)
            run = thread_pool(options.run.threads)
            work = Work(options.run.tile, run, run, checkpoint=options.run.resume)
            found = field_map(open_source(source, options.read), request, work)
        if found.cells is None:
            raise ParameterError(f"{found.warnings[-1]}: crop the raster, or extract a range")
        super().__init__(range=range, height=height)
        data = web_page.data_of(found, collection, flights)
        data |= {"range": [round(STEPS * bound) for bound in self.range]}
        content = web_page.render_page(web_page.title_of(found), data, embedded=True)
        self.set_trait("page", content.decode())
        for warning in (*found.warnings, *web_page.size_notes(content)):
            warnings.warn(warning, stacklevel=2)

    def regions(self) -> "GeoDataFrame":
        """Return the regions of the range that is chosen, to the pixel, as of `uavseg.extract`."""
        return extract(self._source, self.range, **self._words)

    @traitlets.validate("range")  # type: ignore[untyped-decorator]
    def _check_range(self, proposal: dict[str, Any]) -> tuple[float, float]:
        low, high = proposal["value"]
        steps = [STEPS * low, STEPS * high]
        whole = all(math.isfinite(step) and abs(step - round(step)) < 1e-6 for step in steps)
        if not whole or not 0 <= round(steps[0]) < round(steps[1]) <= STEPS:
            raise IntensityRangeError(
                f"expected 0 <= low < high <= 1 in thousandths, such as 0.55,1, got {low:g},{high:g}"
            )
        return round(steps[0]) / STEPS, round(steps[1]) / STEPS

    @traitlets.validate("height")  # type: ignore[untyped-decorator]
    def _check_height(self, proposal: dict[str, Any]) -> int:
        height = int(proposal["value"])
        if not _MIN_HEIGHT <= height <= _MAX_HEIGHT:
            raise ParameterError(f"the height is {_MIN_HEIGHT} to {_MAX_HEIGHT} pixels, not {height}")
        return height
