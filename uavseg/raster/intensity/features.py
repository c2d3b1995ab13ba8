"""Numbers per pixel that bands make: a band itself, the luminance, an index, a ratio, a weighted sum."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from itertools import combinations

import numpy as np

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.raster.intensity.grey import luminance
from uavseg.raster.read.raster_file import choose
from uavseg.raster.spectral.band_names import names_of
from uavseg.raster.spectral.bands import BandChoice, BandLayout, BandScale
from uavseg.raster.spectral.formula import INDICES, BandWords, bind_formula

_MOST_IN_RATIOS = 6  # bands of which all pairs are compared


@dataclass(frozen=True, slots=True)
class Feature:
    """A number per pixel, in the words that choose it."""

    kind: str  # "band" (or luminance), "index" (or ratio) or "sum"; from what is simplest to read
    band: int | None  # the band, if it is one
    words: BandWords  # index or expression, if it is one
    choice: BandChoice = field(repr=False)  # what the words choose

    def values(self, planes: Mapping[int, Floats], scales: Mapping[int, BandScale]) -> Floats:
        """Return its values, in the units of the raster, from stored numbers (n,) of each band."""
        bands = self.choice.bands
        stacked = np.stack([planes[band] for band in bands])
        if self.choice.formula is not None:
            found, _ = self.choice.formula.apply(stacked[..., None], None, [scales[band] for band in bands])
            return found[0, :, 0].astype(np.float64)
        return scales[bands[0]].values(luminance(stacked) if len(bands) == 3 else stacked[0])


def features_of(
    layout: BandLayout,
    bands: Sequence[int],
    rgb: Sequence[int | str] | None,
    words: BandWords,
    integers: bool,
) -> list[Feature]:
    """Return the bands by themselves, the luminance, and all indices and ratios that the bands allow.

    `bands` are the ones to use, `rgb` those of red, green and blue, where they are chosen; of `words` the
    names are kept. `integers` says whether numbers are stored as integers without a scale, for which indices
    of reflectance do not hold.
    """
    found = [Feature("band", band, words, choose(layout, band, None, words)) for band in bands]
    bands = alike(layout, bands)
    if len(bands) in (3, 4):
        whole = choose(layout, None, rgb, words)
        if len(whole.bands) == 3 and set(whole.bands) <= set(bands):
            found.append(Feature("band", None, words, whole))
    for name, index in INDICES.items():
        requested = replace(words, index=name)
        if not (index.of_reflectance and integers) and _uses(layout, requested, bands):
            found.append(Feature("index", None, requested, choose(layout, None, None, requested)))
    texts = _ratios(list(_words(layout, bands).values())) if len(bands) <= _MOST_IN_RATIOS else []
    return found + [_expression(layout, words, text, "index") for text in texts]


def alike(layout: BandLayout, bands: Sequence[int]) -> list[int]:
    """Return the bands that have the type of the first, with which it can be computed."""
    return [band for band in bands if layout.dtypes[band - 1] == layout.dtypes[bands[0] - 1]]


def weighted_sum(
    layout: BandLayout, bands: Sequence[int], weights: Sequence[float], words: BandWords
) -> Feature | None:
    """Return the sum of bands times weights; None where there are fewer than two."""
    called = _words(layout, bands)
    pairs = zip(bands, weights, strict=True)
    terms = [f"{weight:g} * {called[band]}" for band, weight in pairs if weight and band in called]
    if len(terms) < 2:
        return None
    return _expression(layout, words, " + ".join(terms).replace("+ -", "- "), "sum")


def _expression(layout: BandLayout, words: BandWords, text: str, kind: str) -> Feature:
    requested = replace(words, expr=text)
    return Feature(kind, None, requested, choose(layout, None, None, requested))


def _uses(layout: BandLayout, words: BandWords, bands: Sequence[int]) -> bool:
    try:
        formula = bind_formula(words, layout)
    except ParameterError:  # there is no band of a name that it has
        return False
    return formula is not None and set(formula.expression.bands) <= set(bands)


def _words(layout: BandLayout, bands: Sequence[int]) -> dict[int, str]:
    """Return what bands are called in expressions, where they can be: numbers, or names if b1 is another."""
    names = names_of(layout)
    result = {}
    for band in bands:
        own = sorted(filter(str.isidentifier, names[band - 1].keys), key=lambda key: (len(key), key))
        for key in (f"b{band}", *own):
            number = int(key[1:]) if key[0] == "b" and key[1:].isdigit() else band
            if number == band and {name.number for name in names if key in name.keys} <= {band}:
                result[band] = key
                break
    return result


def _ratios(names: Sequence[str]) -> list[str]:
    """Return differences of two bands over their sum, and of more than two the share of each."""
    result = [f"({b} - {a}) / ({b} + {a})" for a, b in combinations(names, 2)]
    if len(names) > 2:
        result += [f"{name} / ({' + '.join(names)})" for name in names]
    return result
