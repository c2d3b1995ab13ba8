"""Writing of results: regions and their labels to the files that a command names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from uavseg.cli.terminal.say import standard_output

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission
    from uavseg.jobs.flights.plan import MissionPlan
    from uavseg.jobs.result.result import Extraction
    from uavseg.jobs.source.work import Work
    from uavseg.options.flights import MissionFileOptions
    from uavseg.options.outputs import CreationOptions as StoredAs
    from uavseg.raster.formats.creation import CreationOptions
    from uavseg.regions.formats.geojson import GeoJsonForm

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class LabelFile:
    """A raster of labels that a command writes: its path, or None, and how it is stored."""

    path: str | None
    creation: CreationOptions

    @classmethod
    def of(cls, path: str | None, stored: StoredAs) -> LabelFile:
        """Return the raster of labels with the options of its storage."""
        return cls(path, creation_of(stored, {path: "uint32"}))


def creation_of(stored: StoredAs, targets: dict[str | None, str]) -> CreationOptions:
    """Return how the GeoTIFFs of a command are stored.

    Parameters
    ----------
    stored : CreationOptions of `uavseg.options`
    targets : dict
        Its outputs, or None, with the type of their pixels.

    Raises
    ------
    ParameterError
        As `creation_for`.
    """
    from uavseg.raster.formats.creation import creation_for

    return creation_for(stored.creation_options, targets)


def check_targets(output: str | None, labels: str | None, overwrite: bool) -> None:
    """Nothing that is there is touched, and nothing is computed that could not be written."""
    if output is not None and output != "-":
        from uavseg.regions.formats.export import check_region_path

        check_region_path(output, overwrite)
    if labels is not None:
        from uavseg.regions.formats.label_raster import check_labels

        check_labels(labels, overwrite)


def check_distinct(*paths: str | None) -> None:
    """Each output has a name of its own.

    Raises
    ------
    OutputError
        If two have the same.
    """
    from uavseg.errors import OutputError

    named = [Path(path).resolve() for path in paths if path and path != "-"]
    if len(set(named)) < len(named):
        raise OutputError("two outputs have the same name; give each its own")


def keep_inputs(outputs: Sequence[str | None], *inputs: Any) -> None:
    """No output is one of the files that the command reads.

    Raises
    ------
    OutputError
        If one is.
    """
    from uavseg.jobs.source import inputs as read

    read.keep_inputs(outputs, inputs)


def transaction() -> AbstractContextManager[None]:
    """Context whose files appear together at its end."""
    from uavseg.output import atomic as files

    return files.transaction()


def write_region_output(
    found: Extraction, target: str, overwrite: bool, form: GeoJsonForm | None = None
) -> None:
    """Write regions to a file, or to stdout where it is called -."""
    from uavseg.output.written import noted_stream
    from uavseg.regions.formats import export
    from uavseg.regions.formats.geojson import COLLECTION

    if target != "-":
        export.write_regions(found.regions, target, overwrite)
        return
    with noted_stream("stdout"), standard_output() as stream:
        export.write_regions(found.regions, stream, form=form or COLLECTION)


def write_regions_and_labels(
    found: Extraction,
    target: str,
    labels: LabelFile,
    work: Work,
    overwrite: bool,
    form: GeoJsonForm | None = None,
    style: str | None = None,
) -> None:
    """Write regions, their style and labels; what goes to stdout comes after all that can fail."""
    if target != "-":
        write_region_output(found, target, overwrite)
    if style is not None:
        from uavseg.regions.formats.styles import write_style

        write_style(found.regions, target, style, overwrite)
    write_label_output(found, labels, work, overwrite)
    if target == "-":
        write_region_output(found, target, overwrite, form)


def write_label_output(found: Extraction, labels: LabelFile, work: Work, overwrite: bool) -> None:
    """Write the labels of regions, if asked for; the executor writes them where they are many tiles."""
    if labels.path is None:
        return
    from uavseg.regions.formats import label_raster

    run = work.executor if label_raster.is_vrt(labels.path) else work.local
    how = overwrite, labels.creation
    label_raster.write_label_raster(labels.path, found.rings, found.geobox, run, *how)


def write_mission_output(mission: Mission, path: str, overwrite: bool) -> list[str]:
    """Write a mission; what its format cannot hold is returned as warnings."""
    from uavseg.flight.formats import files

    return warnings_of(lambda: files.write_mission(mission, path, overwrite))[1]


def write_plan_output(
    planned: MissionPlan, path: str, overwrite: bool, options: MissionFileOptions
) -> tuple[list[Path], list[str]]:
    """Write the missions of a plan; returns their files, and what the format cannot hold as warnings."""
    editable, model = options.editable, options.dji_model
    return warnings_of(lambda: planned.write(path, overwrite, editable=editable, dji_model=model))


def warnings_of(write: Callable[[], T]) -> tuple[T, list[str]]:
    """What a function returns, and its warnings, each once."""
    import warnings

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        result = write()
    return result, list(dict.fromkeys(str(one.message) for one in caught))


def shown(target: str) -> str:
    """A target by its name for people."""
    return "stdout" if target == "-" else target


def summary_rows(found: Extraction) -> dict[str, str]:
    """Total area, largest region, stretch and band, for the table at the end."""
    return {
        **_range_row(found),
        "total area": f"{found.regions.columns['area_m2'].sum():,.1f} {found.area_unit}",
        "largest": largest(found),
        **confidence_row(found),
        "stretch": found.stretch.name,
        "band": found.band_names,
    }


def confidence_row(found: Extraction) -> dict[str, str]:
    """How many regions were left out because of their confidence, if there is a minimum."""
    if found.below_minimum is None:
        return {}
    return {"too unsure": f"{found.below_minimum:,} of {found.below_minimum + len(found.regions):,} left out"}


def _range_row(found: Extraction) -> dict[str, str]:
    """The range that was asked for, in v and in values."""
    if found.wanted is None:
        return {}
    from uavseg.raster.spectral.value_scale import values_text

    interval, ends = found.wanted.interval, found.wanted.ends
    text = f"v {interval.low:.6g} to {interval.high:.6g}"
    if found.axis is None:
        return {"range": text}
    return {"range": f"{text}: {values_text(ends, found.axis.unit)}"}


def largest(found: Extraction) -> str:
    """The region with most pixels, for people."""
    columns = found.regions.columns
    if not len(found.regions):
        return "-"
    return f"{columns['area_m2'][0]:,.1f} {found.area_unit} ({columns['pixels'][0]:,} pixels)"
