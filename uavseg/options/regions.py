"""Options of the jobs over rasters: extract, levels, match, suggest, divide, original, info."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from uavseg.errors import ParameterError
from uavseg.options import reading, texts
from uavseg.options.flights import MissionOptions
from uavseg.options.option import Options, argument, group, option
from uavseg.options.reading import AccessOptions, RasterArguments, ReadOptions
from uavseg.options.running import EachOptions, RegionOutputs, StorageOptions, TiledJobOptions, output_option

if TYPE_CHECKING:
    from uavseg.segmentation.params.segment import SegmentParams

ADVANCED_FLIGHT = ("pattern", "speed", "autopilot", "overlap", "avoid")  # in the help of extract
Sample = str | os.PathLike[str] | tuple[float, float, float]
Ends = Sequence[float | None] | str | None
SAMPLES: dict[str, Any] = {"default": (), "multiple": True, "metavar": "SAMPLE|X,Y,RADIUS", "basic": True}


class RangeOptions(Options):
    """Range."""

    range: Any = option(
        "The range of v, such as 0.55,1. Several are classes, named after their ranges.",
        metavar="LO,HI",
        multiple=True,
        parse=texts.several_ranges,
        basic=True,
    )
    values: Ends = option(
        "In place of --range: values in the raster's own units, after its scale and offset, such as 20,40; "
        "300, and ,35 are open.",
        metavar="LO,HI",
        parse=texts.range_named("--values"),
        basic=True,
    )
    percentile: Ends = option(
        "In place of --range: percentiles of all valid pixels, such as 90,100.",
        metavar="LO,HI",
        parse=texts.range_named("--percentile"),
        basic=True,
    )


class DivisionOptions(Options):
    """Segmentation."""

    method: str = option(
        "Divide blocks by texture and intensity, or by texture alone as the paper does.",
        default="adaptive",
        choices=("adaptive", "paper"),
        label="Method",
    )
    threshold: float = option(
        "Divide where G_max / G_min is larger.", default=1.2, metavar="X", label="Threshold of G_max / G_min"
    )
    intensity_step: float = option(
        "Adaptive: divide where the means of the children differ by more.",
        default=0.05,
        metavar="TAU",
        label="Intensity step",
    )

    def segment_params(self, refine: str | None = None) -> SegmentParams:
        """Return how a source is segmented, checked."""
        from uavseg.segmentation.params.segment import SegmentParams

        return SegmentParams(self.method, self.threshold, self.intensity_step, refine)  # type: ignore[arg-type]


class NeighbourOptions(Options):
    """Segmentation."""

    connectivity: int = option(
        "The neighbours of a pixel: the 4 that share an edge, or 8. Then regions that touch at a corner of a "
        "pixel are one, of several polygons.",
        default=4,
        choices=("4", "8"),
        parse=int,
        label="Connectivity",
    )

    @property
    def diagonally(self) -> bool:
        """Return whether regions that touch at a corner are one, checked."""
        if self.connectivity not in (4, 8):
            raise ParameterError(f"connectivity is 4 (edges) or 8 (corners too), not {self.connectivity}")
        return self.connectivity == 8


class SizeOptions(Options):
    """Small things."""

    detail: float | str | None = option(
        "Leave out what is narrower, cut necks and close gaps that are; before holes are filled.",
        metavar="M|Npx",
        label="Detail to keep (m, or pixels as 9px)",
    )
    min_area: float | str | None = option(
        "Drop regions of less, after holes are filled.",
        metavar="M2|Nha|Npx",
        basic=True,
        label="Smallest area (m², or pixels as 50px)",
    )
    fill_holes: float | str | None = option(
        "Fill holes of less, before small regions are dropped.",
        metavar="M2|Nha|Npx",
        basic=True,
        label="Fill holes up to (m², or pixels as 50px)",
    )
    min_confidence: float | None = option(
        "Drop regions of a lower confidence at last: 0 to 1, the probability of being right, as on real and "
        "drawn pictures.",
        metavar="P",
        label="Smallest confidence",
    )


class DrawingOptions(Options):
    """Outlines."""

    smooth_outline: float | None = option(
        "Draw outlines without stairs, within this many metres of the pixel edges, and never further than "
        "half a pixel; shared borders stay shared, attributes those of the pixels.",
        metavar="METRES",
        label="Smooth outlines within",
    )
    regularize: float | None = option(
        "Draw outlines with right angles and common directions, as of roofs and fields, within this many "
        "metres of the pixel edges, two pixels or more; others stay as they are. Not with --smooth-outline.",
        metavar="METRES",
        label="Right angles within",
    )
    simplify: float | None = option(
        "Simplify outlines, after they are smoothed or regularized; shared borders stay shared.",
        metavar="METRES",
        label="Simplify outlines within",
    )
    stats: str | None = option(
        "Add mean, deviation, minimum and maximum of each band, weighted by the parts of pixels within.",
        choices=("bands",),
    )


class ExtractOptions(TiledJobOptions):
    """Segmentation."""

    source: RasterArguments = group(RasterArguments)
    ranges: RangeOptions = group(RangeOptions)
    class_texts: tuple[str, ...] = option(
        "A class and its range of v, such as water=0,0.2; give one for each class. Each pixel is in one "
        "class at most; an end that two ranges share belongs to the lower one.",
        "--class",
        default=(),
        multiple=True,
        metavar="NAME=LO,HI",
        python=False,
        basic=True,
    )
    classes: Mapping[str, Any] | str | os.PathLike[str] | None = option(
        "Classes from a .csv or .yaml file: name, range (or low and high), color as #rrggbb.",
        metavar="FILE",
        label="File of classes",
    )
    outputs: RegionOutputs = group(
        RegionOutputs,
        output={
            "help": "The regions: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout. A "
            "name that ends in .parquet/ is a folder of files, one for each 8192 x 8192 pixels, for rasters "
            "of any size.  [default: STEM.regions.geojson here]"
        },
    )
    creation: StorageOptions = group(StorageOptions)
    read: ReadOptions = group(ReadOptions, *reading.ONLY_MAPS, **reading.RASTER_STRETCH)
    division: DivisionOptions = group(DivisionOptions)
    refine: str | None = option(
        "How boundaries are found to the pixel: by total variation, four scans or a local mean; those of "
        "classes by tv or none. Or pixels: every pixel by its own value, as a threshold and a polygonizer "
        "do.",
        choices=("tv", "scan", "none", "smooth", "pixels"),
        shown="tv; with --method paper scan, and none for classes",
        label="Refinement",
    )
    neighbours: NeighbourOptions = group(NeighbourOptions)
    sizes: SizeOptions = group(SizeOptions)
    thin_lines: bool = option(
        "Also find lines of 1 to 3 pixels (cracks, tracks) in one range by their contrast along 15 pixels.",
        default=False,
        label="Add thin lines",
    )
    drawing: DrawingOptions = group(DrawingOptions)
    each: EachOptions = group(EachOptions)
    mission: str | None = option(
        "Also plan a mission over the regions: a file as of uavseg plan.",
        metavar="PATH",
        python=False,
        basic=True,
    )
    mission_classes: tuple[str, ...] = option(
        "Fly over regions of this class only. May be given several times.",
        "--mission-class",
        default=(),
        multiple=True,
        metavar="NAME",
        python=False,
    )
    avoid_classes: tuple[str, ...] = option(
        "Regions of this class are keep-out zones. May be given several times.",
        "--avoid-class",
        default=(),
        multiple=True,
        metavar="NAME",
        python=False,
    )
    flight: MissionOptions = group(
        MissionOptions, python=False, **{name: {"basic": False} for name in ADVANCED_FLIGHT}
    )


class CompareOptions(TiledJobOptions):
    """Comparison."""

    before: str = argument("BEFORE", required=True)
    after: str = argument("AFTER", required=True)
    ranges: RangeOptions = group(RangeOptions)
    classes: Mapping[str, Any] | str | os.PathLike[str] | None = option(
        "Classes from a .csv or .yaml file, as of extract.", metavar="FILE", basic=True
    )
    refine: str | None = option(
        "How boundaries are found, as of extract.",
        choices=("tv", "scan", "none", "smooth", "pixels"),
        shown="tv; none for classes",
    )
    min_area: float | str | None = option(
        "Leave out changes of less; the sums count them.", metavar="M2|Nha|Npx", basic=True
    )
    output: str = output_option(
        "The changes: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.", "PATH"
    )
    png: str | None = option("Draw them over AFTER, too.", metavar="PATH.png", python=False, basic=True)
    read: ReadOptions = group(
        ReadOptions, *reading.ONLY_MAPS, "flatten", "skip_bad_tiles", **reading.MAP_STRETCH
    )


class LevelsOptions(TiledJobOptions):
    """Levels."""

    source: RasterArguments = group(RasterArguments)
    width: float | None = option(
        "Width of a level in v, such as 0.1.", metavar="P", basic=True, label="Width of a level in v"
    )
    breaks: Sequence[float] | str | None = option(
        "In place of a width: the values of v between levels, such as 0.2,0.5; or K levels with the smallest "
        "variance within (otsu, as suggest --classes K) or the same number of pixels (quantile, 5).",
        metavar="V,V,...|otsu[:K]|quantile[:K]",
        basic=True,
        label="Breaks",
    )
    outputs: RegionOutputs = group(
        RegionOutputs,
        output={
            "help": "The segments: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.  "
            "[default: STEM.levels.geojson here]"
        },
        labels={
            "help": "Also write the labels of the segments as a raster: one .tif, or a .vrt over a folder of "
            "tiles."
        },
    )
    creation: StorageOptions = group(StorageOptions)
    read: ReadOptions = group(ReadOptions, *reading.ONLY_MAPS, **reading.RASTER_STRETCH)
    division: DivisionOptions = group(DivisionOptions)
    refine: str | None = option(
        "How boundaries are found to the pixel: by total variation, or left at the edges of blocks. Or "
        "pixels: every pixel by its own value.",
        choices=("tv", "none", "pixels"),
        shown="tv; none with --method paper",
        label="Refinement",
    )
    neighbours: NeighbourOptions = group(NeighbourOptions)
    sizes: SizeOptions = group(
        SizeOptions,
        "fill_holes",
        detail={"help": "Give what is narrower to the levels near it, before small segments are merged."},
        min_area={"help": "Merge segments of less into their neighbours, or drop them."},
    )
    small: str = option(
        "What becomes of small segments. Merge: one after the other, the smallest first, becomes part of the "
        "neighbour with the longest common border (then the nearest mean); one that has grown enough stays.",
        default="merge",
        choices=("merge", "drop"),
        label="Small segments",
    )
    drawing: DrawingOptions = group(DrawingOptions)
    each: EachOptions = group(EachOptions)


class MatchOptions(TiledJobOptions):
    """Comparison."""

    source: RasterArguments = group(RasterArguments)
    like: Sample | Sequence[Sample] = option(
        "The sample: a file of polygons, or a disc in the raster's coordinates (RADIUS in their unit; in "
        "metres where they are degrees). May be given several times.",
        **SAMPLES,
    )
    unlike: Sequence[Sample] = option(
        "A sample of what is not wanted; may be given several times.", **SAMPLES
    )
    classes: str | os.PathLike[str] | None = option(
        "In place of --like: a file of polygons with a column class; every pixel is of the likeliest class, "
        "or of none.",
        metavar="SAMPLES",
        basic=True,
    )
    ask: Any = option(
        "Ask about places whose answers help most, until none helps much: yes adds a --like, no an --unlike. "
        "Each is drawn in STEM.place.png beside the output; answers are read from standard input.",
        type=bool,
        basic=True,
    )
    outputs: RegionOutputs = group(
        RegionOutputs,
        output={
            "help": "The regions: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.  "
            "[default: STEM.match.geojson here]"
        },
    )
    png: str | None = option(
        "Draw each answer over the raster, too, beside each other.",
        metavar="PATH.png",
        python=False,
        basic=True,
    )
    creation: StorageOptions = group(StorageOptions)
    by: str = option(
        "What is compared: color, texture with intensity, or what parts the sample from the raster.",
        default="auto",
        choices=("auto", "color", "texture"),
        basic=True,
        label="Compare by",
    )
    answer: int = option(
        "The answer to write: 1 the whole kind; by color also 2, what touches the sample, of finer kinds, or "
        "3, finer kinds.",
        default=1,
        metavar="N",
        basic=True,
        label="Answer",
    )
    window: int | None = option(
        "Side of the window whose texture is compared: 16, 24, 32, 48, 64, 96 or 128.  "
        "[default: 32, or 24 or 16 where the sample is small]",
        metavar="PIXELS",
        label="Window",
    )
    similarity: float = option(
        "How like the sample's own windows a window must be, up to 1; less finds more.",
        default=0.9,
        metavar="S",
        label="Similarity",
    )
    intensity: float = option(
        "By how many of the sample's deviations the mean may differ; inf: texture alone.",
        default=1.0,
        metavar="K|inf",
        label="Deviations of intensity",
    )
    bands: Sequence[int | str] = option(
        "Compare these bands, each by itself; beside texture too.",
        default=(),
        metavar="BAND,...",
        parse=texts.bands,
        label="Bands to compare",
    )
    read: ReadOptions = group(
        ReadOptions,
        *reading.ONLY_MAPS,
        **reading.RASTER_STRETCH,
        flatten={
            "help": "Take away light that changes slowly over this width, several times that of what is "
            "sought, from the intensity and from each band that is compared (at most four)."
        },
    )
    refine: str = option(
        "Boundaries to the pixel, or at the edges of cells of 8 pixels.",
        default="pixel",
        choices=("pixel", "none"),
        label="Refinement",
    )
    sizes: SizeOptions = group(SizeOptions, min_area={"help": "Drop regions of less."})
    drawing: DrawingOptions = group(
        DrawingOptions,
        *("smooth_outline", "regularize", "stats"),
        simplify={"help": "Simplify; shared borders stay shared."},
    )
    each: EachOptions = group(EachOptions)


class SuggestOptions(TiledJobOptions):
    """Ranges."""

    source: RasterArguments = group(RasterArguments)
    output: str | None = output_option(
        "Also draw the ranges beside the histogram.", "PATH.png", required=False
    )
    classes: int | str = option(
        "How many ranges: 2 to 8, of Otsu's thresholds alone, or as many as the raster has by itself.",
        default="auto",
        metavar="N|auto",
        parse=texts.count_or_auto,
        basic=True,
        label="How many ranges",
    )
    like: Sample | Sequence[Sample] = option(
        "The band, index or sum of bands and the range of its values that part this sample best: a file of "
        "polygons, or a disc in the raster's coordinates. May be given several times.",
        **SAMPLES,
    )
    unlike: Sequence[Sample] = option(
        "With --like: a sample of what is not wanted; may be given several times.",
        **SAMPLES,
        label="Samples of what to leave out",
    )
    bands: Sequence[int | str] = option(
        "With --like: look at these bands alone.",
        default=(),
        metavar="BAND,...",
        parse=texts.bands,
        label="Bands to look at",
    )
    as_json: bool = option("Write JSON, for programs.", "--json", default=False, python=False, basic=True)
    read: ReadOptions = group(ReadOptions, *reading.ONLY_MAPS, **reading.RASTER_STRETCH)
    division: DivisionOptions = group(DivisionOptions)


class DivideOptions(TiledJobOptions):
    """Block map."""

    source: RasterArguments = group(RasterArguments)
    output: str = output_option("The block map.", "PATH.tif")
    creation: StorageOptions = group(StorageOptions)
    read: ReadOptions = group(ReadOptions, *reading.ONLY_MAPS, **reading.RASTER_STRETCH)
    division: DivisionOptions = group(DivisionOptions, python=False)


class OriginalOptions(TiledJobOptions):
    """LBP/C of Ojala and Pietikäinen."""

    source: RasterArguments = group(RasterArguments)
    output: str = output_option("The labels of the segments.", "LABELS.tif")
    creation: StorageOptions = group(StorageOptions)
    threshold: float = option("Divide where G_max / G_min is larger.", default=1.2, metavar="X", basic=True)
    merge_stop: float = option(
        "Stop merging where MI / (largest MI before) is larger.", default=2.0, metavar="Y", basic=True
    )
    untested: float = option(
        "Of all possible merges, during which that is not tested.", default=0.1, metavar="SHARE"
    )
    radius: int = option("Of the disc around a pixel.", default=11, metavar="PIXELS")
    sweeps: int = option("Over the pixels along boundaries.", default=32, metavar="N")
    read: ReadOptions = group(ReadOptions, *reading.ONLY_MAPS, "flatten", **reading.RASTER_STRETCH)


class InfoOptions(Options):
    """Information."""

    source: RasterArguments = group(RasterArguments)
    as_json: bool = option("Write JSON, for programs.", "--json", default=False, python=False, basic=True)
    read: ReadOptions = group(ReadOptions, *reading.ONLY_MAPS, "flatten", **reading.RASTER_STRETCH)
    threads: int | None = option("Threads to count with.  [default: all cores]", minimum=1, basic=True)
    verbose: bool = option(
        "Say what was decided, and how long it took.",
        *("-v", "--verbose"),
        default=False,
        python=False,
        basic=True,
    )
    access: AccessOptions = group(AccessOptions)
