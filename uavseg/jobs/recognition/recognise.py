"""Recognition job: regions named by the described examples whose outline and texture fit them best."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import ParameterError, RegionError
from uavseg.execution.executors import phase, steps_done
from uavseg.jobs.recognition.describe import Description, described
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.jobs.source.work import Work
from uavseg.options.recognition import RecogniseOptions
from uavseg.raster.access.opening import file_exists
from uavseg.regions.formats.export import check_region_path, write_regions
from uavseg.regions.formats.read import read_regions
from uavseg.regions.recognise.fit import Evidence, Outline, evidence_of_polygon, log_evidence
from uavseg.regions.recognise.measures import largest_part, local_metres, objects
from uavseg.regions.table import Regions
from uavseg.segmentation.blocks.g_statistic import g_statistic

CANNOT_TELL = "cannot tell"
MAX_EXAMPLES = 500
# Log-evidence of an object of no name by independent point of its surface, and the temperature of evidences:
# calibrated on simulated scenes other than those of benchmarks/recognition.py.
_NO_NAME, _TEMPERATURE = -0.35, 1.5
_TEXTURE_SAMPLES = 32.0  # texture counts as so many independent pixels
_COMPLETE = 0.8  # share of the outline of an example that should have been seen

Counts = NDArray[np.int64]


def recognised(options: RecogniseOptions, work: Work) -> Description:
    """Name regions or objects by the examples of a library; or add them to it, and return all of it."""
    path = options.library
    if options.learn is None:
        if options.ids is not None:
            raise ParameterError("ids are those of examples to learn; give their name too (--learn)")
        library = _named(read_regions(path, local=True))
        return _recognised(described(options, work), library, options.min_probability, work)
    keep_inputs([path], [options.source, options.raster])
    check_region_path(path, True)
    before = read_regions(path, local=True) if file_exists(path) else None
    learned = _learned(described(options, work), before, options.learn, list(options.ids or ()))
    write_regions(learned.regions, path, overwrite=True)
    return learned


def _named(library: Regions) -> Regions:
    """Return the examples that have a name."""
    names = library.columns.get("name", np.full(len(library), "", object)).tolist()
    library = library.select(
        np.array([isinstance(n, str) and n not in ("", CANNOT_TELL) for n in names], bool)
    )
    if not 0 < len(library) <= MAX_EXAMPLES:
        raise RegionError(
            f"the library has {len(library):,} examples with a name (column 'name'), and 1 to {MAX_EXAMPLES} "
            "are expected; recognise --learn NAME --ids N,... adds some"
        )
    return library


def _recognised(found: Description, library: Regions, minimum: float, work: Work) -> Description:
    if not 0 <= minimum <= 1:
        raise ParameterError(f"a probability lies in 0..1, not {minimum:g}")
    names = library.columns["name"].astype(str)
    outlines = [Outline(largest_part(polygon)) for polygon in local_metres(library)]
    textures, known = _textures(found.regions), _textures(library)
    evidence = found.evidence
    if evidence is None:
        evidence = tuple(evidence_of_polygon(largest_part(one)) for one in found.outlines)

    def fits(one: Evidence | None) -> list[tuple[float, float]]:
        return [] if one is None else [log_evidence(outline, one) for outline in outlines]

    rows = []
    with phase("fit"):
        for k, (one, pairs) in enumerate(zip(evidence, work.local(fits, evidence), strict=True)):
            rows.append(_choose(one, pairs, names, [_log_texture(textures[k], other) for other in known]))
            steps_done(k + 1, len(evidence))
    nearest, probability, second, other, misfit = zip(*rows, strict=True) if rows else ((),) * 5
    columns: dict[str, NDArray[Any]] = {
        "name": np.array(
            [n if p >= minimum else CANNOT_TELL for n, p in zip(nearest, probability, strict=True)], object
        ),
        "probability": np.array(probability, np.float64),
        "nearest": np.array(nearest, object),
        "second": np.array(second, object),
        "second_probability": np.array(other, np.float64),
        "misfit": np.array(misfit, np.float64),
    }
    warnings = found.warnings
    if lost := sum(one is None for one in evidence):
        warnings += (f"{lost:,} objects are too large or too faint to be fitted: {CANNOT_TELL}",)
    regions = replace(found.regions, columns={**found.regions.columns, **columns})
    return replace(found, regions=regions, warnings=warnings)


def _choose(
    evidence: Evidence | None, fits: list[tuple[float, float]], names: NDArray[np.str_], textures: list[float]
) -> tuple[str, float, str, float, float]:
    """Return the most probable name with its probability, the second, and the misfit of the best fit.

    A name has the mean evidence of its examples; that of no name is what a mediocre fit has.
    """
    if evidence is None:
        return "", 0.0, "", 0.0, math.nan
    scores = np.array([score for score, _ in fits]) + textures
    kinds, top = np.unique(names), scores.max()
    of_kinds = [top + math.log(np.exp(scores[names == kind] - top).mean() + 1e-300) for kind in kinds]
    exponents = np.array([*of_kinds, _NO_NAME * evidence.samples]) / _TEMPERATURE
    shares = np.exp(exponents - exponents.max())
    shares = np.round(shares / shares.sum(), 6)
    first, second = [*np.argsort(-exponents[:-1], kind="stable"), -1][:2]
    misfit = -2 * max(best for _, best in fits) / evidence.samples
    other = ("", 0.0) if second == -1 else (str(kinds[second]), float(shares[second]))
    return str(kinds[first]), float(shares[first]), *other, round(misfit, 6)


def _log_texture(first: Counts | None, second: Counts | None) -> float:
    """Return the log-likelihood ratio of one texture against two, G by pixel less its expectation."""
    if first is None or second is None:
        return 0.0
    pixels = 1 / (1 / first.sum() + 1 / second.sum())
    by_chance = (np.count_nonzero(first + second) - 1) / (2 * pixels)
    return -_TEXTURE_SAMPLES * max(float(g_statistic(first, second) / (2 * pixels) - by_chance), 0.0)


def _textures(regions: Regions) -> list[Counts | None]:
    """Return the histograms of the column `texture`; None where there is none."""
    found: list[Counts | None] = []
    for text in regions.columns.get("texture", np.full(len(regions), "", object)):
        words = str(text).split()
        valid = len(words) == 80 and all(one.isascii() and one.isdigit() and len(one) < 13 for one in words)
        counts = np.array([int(one) for one in words] if valid else [0], np.int64)
        found.append(counts if counts.any() else None)
    return found


def _learned(found: Description, library: Regions | None, name: str, ids: list[int]) -> Description:
    """Return a library with regions of these ids as further examples: in metres around their centroids."""
    have = found.regions.columns["id"].tolist()
    if not name.isprintable() or name.strip() in ("", CANNOT_TELL):
        raise ParameterError(f"an example needs a printable name other than {CANNOT_TELL!r}")
    if not ids or not set(ids) <= set(have):
        unknown = ", ".join(str(k) for k in ids if k not in have) or "none was named (--ids N,...)"
        raise ParameterError(f"examples are regions by their ids, of which there is no such one: {unknown}")
    if library is not None and library.wkt is not None:
        raise RegionError(
            "the library has a CRS, so --learn did not make it; name examples there, or begin anew"
        )
    chosen = [have.index(k) for k in dict.fromkeys(ids)]
    added = found.regions.select(np.array(chosen, np.int64))
    polygons = []
    for outline in (found.outlines[k] for k in chosen):
        middle = shapely.get_coordinates(outline.centroid)
        polygons.append(shapely.transform(outline, lambda xy, m=middle: xy - m))
    parts = [*([] if library is None else [library]), added]
    parts[-1] = replace(added, columns={**added.columns, "name": np.full(len(added), name, object)})
    columns: dict[str, NDArray[Any]] = {}
    for column in dict.fromkeys(one for part in parts for one in part.columns):
        is_text = any(
            part.columns[column].dtype.kind not in "iufb" for part in parts if column in part.columns
        )
        empty = "" if is_text else np.nan
        values = [part.columns.get(column, np.full(len(part), empty)) for part in parts]
        columns[column] = np.concatenate([value.astype(object) if is_text else value for value in values])
    columns["id"] = np.arange(1, sum(map(len, parts)) + 1)
    polygons = [*([] if library is None else library.polygons), *polygons]
    seen = added.columns.get("seen_outline", np.ones(len(added))).tolist()
    hidden = [have[k] for k, share in zip(chosen, seen, strict=True) if share < _COMPLETE]
    warnings = tuple(
        f"part of the outline of region {k} was not seen; it is learned as it is drawn" for k in hidden
    )
    regions = Regions(columns, objects(polygons), None)
    return Description(regions, tuple(polygons), None, found.warnings + warnings)
