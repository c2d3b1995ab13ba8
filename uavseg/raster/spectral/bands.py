"""Bands as intensity: selection, data type and bit depth, nodata; scale, offset and unit of their values."""

import math
from collections.abc import Sequence
from math import inf, nan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError, caused_errors
from uavseg.plain_text import one_line

if TYPE_CHECKING:
    from uavseg.raster.spectral.formula import Formula


_MAX_UNIT = 24  # characters
Values = NDArray[Any]
Valid = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class BandScale:
    """The scale, offset and unit of a band, as GDAL keeps them: value = scale * stored + offset."""

    scale: float = 1.0  # not 0
    offset: float = 0.0
    unit: str = ""  # such as "m" or "degC"; empty where it is not known

    @classmethod
    def of_tags(cls, scale: object, offset: object, unit: object) -> "BandScale | None":
        """Make it from what a file says; None where its numbers are no scale and offset.

        Examples
        --------
        >>> BandScale.of_tags(0.1, None, "degC"), BandScale.of_tags(0.0, 0.0, None)
        (BandScale(scale=0.1, offset=0.0, unit='degC'), None)
        """
        try:
            numbers = float(1.0 if scale is None else scale), float(0.0 if offset is None else offset)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            return None
        if not all(map(math.isfinite, numbers)) or numbers[0] == 0:
            return None
        return cls(*numbers, one_line(str(unit or "").strip(), _MAX_UNIT))

    def inverted(self, maximum: float) -> "BandScale":
        """Return the scale of maximum - stored in place of the stored numbers."""
        return BandScale(-self.scale, self.offset + self.scale * maximum, self.unit)

    def values(self, stored: ArrayLike) -> Floats:
        """Return values of stored numbers."""
        return np.asarray(stored, np.float64) * self.scale + self.offset

    def stored(self, value: float) -> float:
        """Return the stored number of a value; without scale and offset, the value itself."""
        return (value - self.offset) / self.scale


AS_STORED = BandScale()  # values are the stored numbers, of no known unit


@dataclass(frozen=True, slots=True)
class ValueAxis:
    """How v maps to values in the units of a raster, for a fitted stretch.

    Examples
    --------
    >>> axis = ValueAxis(100.0, 300.0, BandScale(0.1, 0.0, "degC"), (0.0, 65535.0))
    >>> axis.values([0.0, 0.5]), axis.text(0.5, 1.0)
    (array([10., 20.]), '20 degC and more')
    """

    low: float  # the stored intensity that is v = 0
    high: float  # and v = 1
    scale: BandScale = AS_STORED
    limits: tuple[float, float] = (-inf, inf)  # the smallest and the largest intensity that can be stored

    @property
    def unit(self) -> str:
        """Unit of the values; empty where it is not known."""
        return self.scale.unit

    @property
    def clips(self) -> bool:
        """Whether intensities may lie beyond the ends."""
        return self.low > self.limits[0] or self.high < self.limits[1]

    def values(self, v: ArrayLike) -> Floats:
        """Return the value of each v; NaN where the stretch ends at infinity."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.scale.values(self.low + np.asarray(v, np.float64) * (self.high - self.low))

    def ends(self, low: ArrayLike, high: ArrayLike) -> tuple[Floats, Floats]:
        """Return the smallest and the largest value of ranges of v; NaN where a range is open.

        It is open at v = 0 or 1 where the stretch clips, because all that lies beyond has that v.
        """
        low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        first = np.where((low <= 0) & (self.low > self.limits[0]), nan, self.values(low))
        last = np.where((high >= 1) & (self.high < self.limits[1]), nan, self.values(high))
        return (first, last) if self.scale.scale > 0 else (last, first)

    def text(self, low: float, high: float) -> str:
        """Return a range of v in values: "20 to 40 degC", "20 degC and more"."""
        first, last = self.ends(low, high)
        return values_text((float(first), float(last)), self.unit)


def values_text(ends: Sequence[float], unit: str = "") -> str:
    """Return a range of values for people; an end that is NaN is open.

    Examples
    --------
    >>> values_text((20, 40.0), "degC"), values_text((float("nan"), 3.25)), values_text((1e-9, float("nan")))
    ('20 to 40 degC', '3.25 and less', '1e-09 and more')
    """
    low, high = ends
    unit = f" {unit}" if unit else ""
    if math.isnan(low) and math.isnan(high):
        return "all values"
    if math.isnan(low):
        return f"{high:.6g}{unit} and less"
    if math.isnan(high):
        return f"{low:.6g}{unit} and more"
    return f"{low:.6g} to {high:.6g}{unit}"


@dataclass(frozen=True, slots=True)
class BandLayout:
    """Types, colour interpretations and bit depths of the bands of a file, first band first."""

    dtypes: tuple[str, ...]
    roles: tuple[str, ...]  # colour interpretations: "red", "alpha", "undefined", ...
    bits: tuple[int, ...]  # that are used: 12 for 12-bit data stored as uint16
    descriptions: tuple[str, ...] = ()  # "" for a band without; empty if no band has one
    micrometres: tuple[float | None, ...] = ()  # central wavelengths; empty if none is known

    @property
    def alpha(self) -> int | None:
        """The alpha band, counted from 1."""
        return self.roles.index("alpha") + 1 if "alpha" in self.roles else None


@dataclass(frozen=True, slots=True)
class BandChoice:
    """The bands that are read as intensity: one, three for luminance, or those of a formula."""

    bands: tuple[int, ...]  # counted from 1
    dtype: np.dtype[np.generic]  # of the bands, as are the bits
    bits: int
    expanded: bool = False  # the one band is an index into a palette, read as three bands of colours
    formula: "Formula | None" = None
    stacked: bool = False  # bands that are no colours

    @property
    def by_band(self) -> bool:
        """Whether nodata in any band makes a pixel invalid."""
        return self.stacked or self.formula is not None

    @property
    def planes(self) -> int:
        """Number of values per pixel that is read: 3 for luminance, else one for each band."""
        return 3 if self.expanded else len(self.bands)

    @property
    def name(self) -> str:
        """Description for messages: "band 1", "luminance of bands 1,2,3"."""
        if self.formula is not None:
            return self.formula.name
        if self.expanded:
            return f"luminance of the palette of band {self.bands[0]}"
        if len(self.bands) == 1:
            return f"band {self.bands[0]}"
        return f"luminance of bands {','.join(map(str, self.bands))}"


def choose_bands(
    layout: BandLayout,
    band: int | None = None,
    rgb: Sequence[int] | None = None,
    palette: bool = False,
    formula: "Formula | None" = None,
) -> BandChoice:
    """Choose the bands that become intensity.

    `band` names one, `rgb` three, `formula` those that it computes with. The default is luminance if the file
    has colours (or three or four bands that are not alpha), and the first band otherwise. The indices of a
    palette are read as they are only if `band` or `formula` names their band. A ParameterError says that
    both `band` and `rgb` are given, or that a band does not exist, a RasterError that the bands cannot be
    intensity: complex numbers, CMYK, three bands of different types.

    Examples
    --------
    >>> layout = BandLayout(("uint8",) * 4, ("blue", "green", "red", "alpha"), (8,) * 4)
    >>> choose_bands(layout).bands, choose_bands(layout, band=2).bands
    ((3, 2, 1), (2,))
    """
    if band is not None and rgb is not None:
        raise ParameterError("give band or rgb, not both")
    if palette and band is None and rgb is None and formula is None:
        return BandChoice((1,), np.dtype(np.uint8), 8, expanded=True)
    named = (band,) if band is not None else tuple(rgb) if rgb is not None else None
    named = named if formula is None else formula.expression.bands
    if rgb is not None and len(rgb) != 3:
        raise ParameterError(f"rgb takes three bands, for instance 1,2,3, not {len(rgb)}")
    bands, count = named or _default_bands(layout), len(layout.dtypes)
    for number in bands:
        if not 1 <= number <= count:
            there = "one band" if count == 1 else f"bands 1 to {count}"
            raise ParameterError(f"there is no band {number}: the raster has {there}")
    bits = max(layout.bits[number - 1] for number in bands)
    return BandChoice(bands, _common_type(layout, bands), bits, formula=formula)


def _default_bands(layout: BandLayout) -> tuple[int, ...]:
    roles = layout.roles
    if {"red", "green", "blue"} <= set(roles):
        return tuple(roles.index(color) + 1 for color in ("red", "green", "blue"))
    if "Y" in roles:
        return (roles.index("Y") + 1,)
    if "cyan" in roles:
        raise RasterError("the bands are printing inks (CMYK); name one with --band, or convert them to RGB")
    plain = tuple(number for number, role in enumerate(roles, start=1) if role != "alpha") or (1,)
    return plain[:3] if len(plain) >= 3 else plain[:1]


def _common_type(layout: BandLayout, bands: tuple[int, ...]) -> np.dtype[np.generic]:
    names = {layout.dtypes[number - 1] for number in bands}
    if len(names) > 1:
        types = ", ".join(sorted(names))
        raise RasterError(f"bands {bands} have different types ({types}); name one with --band")
    name = names.pop()
    if name.startswith("complex"):
        raise RasterError(f"the pixels are complex numbers ({name}); make a raster of their magnitude first")
    return np.dtype("float32" if name == "float16" else name)


def usable_nodata(nodata: float | None, dtype: np.dtype[np.generic]) -> tuple[float | None, str | None]:
    """Return the nodata value if pixels of `dtype` can hold it, else None and a warning.

    Examples
    --------
    >>> usable_nodata(255, np.dtype("uint8"))
    (255, None)
    >>> usable_nodata(-9999.0, np.dtype("uint8"))
    (None, 'nodata -9999 does not fit uint8 pixels, so no pixel can have it: it is ignored')
    """
    if nodata is None:
        return None, None
    if dtype.kind == "f":
        fits = not math.isfinite(nodata) or abs(nodata) <= float(np.finfo(dtype.name).max) * (1 + 1e-6)
    else:
        limits = np.iinfo(dtype.name)
        fits = math.isfinite(nodata) and nodata == int(nodata) and limits.min <= nodata <= limits.max
    if fits:
        return nodata, None
    return None, f"nodata {nodata:g} does not fit {dtype} pixels, so no pixel can have it: it is ignored"


def as_nodata(value: float | str | None) -> float | str | None:
    """Check which nodata a user names: V beside that of the files, "only:V" in its place, "none" for none.

    A ParameterError says that it is a text of another form.

    Examples
    --------
    >>> as_nodata("0"), as_nodata("only: -9999"), as_nodata("NONE"), as_nodata("only:nan")
    (0.0, 'only:-9999', 'none', 'only:nan')
    """
    if not isinstance(value, str):
        return None if value is None else float(value)  # of numpy too
    text = value.strip().lower()
    if text == "none":
        return text
    number = text.removeprefix("only:")
    expected = "nodata is a number, only:NUMBER (without that of the file) or none"
    with caused_errors(f"{expected}, not {value!r}", ParameterError, ValueError, form="{}"):
        found = float(number)
    return found if number == text else f"only:{found:.17g}"


def nodata_in_place(value: float | str | None) -> tuple[float | None, bool]:
    """Return the number that a user names as nodata, and whether it takes the place of that of the files."""
    value = as_nodata(value)
    if not isinstance(value, str):
        return value, False
    return (None if value == "none" else float(value.removeprefix("only:"))), True


def valid_pixels(
    values: Values,
    nodatas: Sequence[float | None],
    alpha: Values | None,
    mask: Valid | None,
    by_band: bool = False,
    added: float | None = None,
) -> Valid | None:
    """Return which pixels are valid; None if all are.

    A pixel is invalid where `mask` is false, alpha is 0 or a band is not finite. With one band it is invalid
    where the band is nodata, and `by_band` where any band is. Of several bands, a nodata value that cannot be
    a colour (of float bands, or negative) makes a pixel invalid where *any* band has it; one that can be (0
    or 255 of a photograph) only where *all* have it, as in GDAL's mask of a whole file. `values` are (bands,
    rows, cols); there is one of `nodatas` for each band, and `added` is another one, of all. `alpha` and
    `mask` are (rows, cols).
    """
    invalid = [] if mask is None else [~mask]
    if alpha is not None:
        invalid.append(alpha == 0)
    if values.dtype.kind == "f":
        invalid += [~np.isfinite(plane) for plane in values]
    invalid += _nodata_pixels(values, nodatas, by_band)
    if added is not None:
        invalid += _nodata_pixels(values, [added] * len(values), by_band)
    if not invalid:
        return None
    total = invalid[0]
    for other in invalid[1:]:
        total |= other
    return ~total if total.any() else None


def without(valid: Valid | None, masked: Valid) -> Valid:
    """Return which pixels are valid where masked ones are not; `valid` is None where all were."""
    return ~masked if valid is None else valid & ~masked


def _nodata_pixels(values: Values, nodatas: Sequence[float | None], by_band: bool) -> list[Valid]:
    numbers = [None if nodata is None or math.isnan(nodata) else nodata for nodata in nodatas]
    pairs = zip(values, numbers, strict=True)
    hits = [_equal(plane, number) for plane, number in pairs if number is not None]
    not_a_color = values.dtype.kind == "f" or any(number is not None and number < 0 for number in numbers)
    if by_band:
        return hits
    if len(hits) <= 1 or not_a_color:
        return hits if not_a_color or len(values) == 1 else []
    return [np.logical_and.reduce(hits)] if len(hits) == len(values) else []


def _equal(plane: Values, number: float) -> Valid:
    """Return where pixels equal `number`, rounded and clipped to their type."""
    if plane.dtype.kind == "f":
        limit = float(np.finfo(plane.dtype.name).max)
        number = min(max(number, -limit), limit)
    hits: Valid = plane == plane.dtype.type(number)
    return hits
