"""GeoTIFF creation options: lossless compression and the size of offsets, as GDAL names them."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, caused_errors
from uavseg.execution.executors import threads_of_gdal
from uavseg.plain_text import joined, one_line, shown

_INTERNAL = ("NONE", "DEFLATE", "LZW", "PACKBITS")  # every build of GDAL has them
_EXTERNAL = ("ZSTD", "LZMA")  # some builds have them
_PREDICTED = ("DEFLATE", "LZW", "ZSTD")
_LEVELS = {"ZLEVEL": ("DEFLATE", 9), "ZSTD_LEVEL": ("ZSTD", 22)}  # the compression that has it, the highest
_BIGTIFF = ("YES", "NO", "IF_NEEDED", "IF_SAFER")
_SUFFIXES = (".tif", ".tiff", ".vrt")  # a VRT is over tiles that are GeoTIFFs
_FLOATS = 3  # the predictor of floating point values


@dataclass(frozen=True, slots=True)
class CreationOptions:
    """How a GeoTIFF is stored. Its pixels are the same whatever is chosen."""

    compress: str = "DEFLATE"  # DEFLATE, LZW, ZSTD, LZMA, PACKBITS or NONE
    level: int | None = None  # of DEFLATE (1 to 9) or ZSTD (1 to 22); by default 6, and GDAL's own
    predictor: int = 1  # 1 none, 2 differences between neighbours, 3 for floating point values
    bigtiff: str = "IF_SAFER"  # "YES", "NO", "IF_NEEDED", "IF_SAFER": whether offsets have 64 bits
    threads: int = 1  # number of threads that compress; the bytes of the file do not depend on it

    @classmethod
    def of(cls, words: Mapping[str, Any] | Iterable[str] | None) -> "CreationOptions":
        """Return the options that words name: {"compress": "zstd"} or ["COMPRESS=ZSTD"], in any case.

        A ParameterError says that a name is not allowed or is given twice, that a value does not fit, or that
        this build of GDAL lacks the compression.

        Examples
        --------
        >>> CreationOptions.of(["COMPRESS=LZW", "predictor=2"]).gdal_options()["compress"]
        'LZW'
        """
        given = _pairs(words or {})
        compress = _one_of("COMPRESS", given.get("COMPRESS", cls().compress), (*_INTERNAL, *_EXTERNAL))
        _check_built(compress)
        levels = [_level(name, given[name], compress) for name in _LEVELS if name in given]
        predictor = int(_one_of("PREDICTOR", given.get("PREDICTOR", "1"), ("1", "2", "3")))
        if predictor > 1 and compress not in _PREDICTED:
            raise ParameterError(
                f"PREDICTOR={predictor} does not go with COMPRESS={compress}; it is for {joined(_PREDICTED)}"
            )
        bigtiff = _one_of("BIGTIFF", given.get("BIGTIFF", cls().bigtiff), _BIGTIFF)
        return cls(compress, levels[0] if levels else None, predictor, bigtiff)

    def check_types(self, *types: Any) -> None:
        """Refuse the predictor of floating point values for pixels of integer types (ParameterError)."""
        import numpy as np

        integers = [np.dtype(one).name for one in types if np.dtype(one).kind != "f"]
        if self.predictor == _FLOATS and integers:
            raise ParameterError(
                f"PREDICTOR=3 is for floating point values; {integers[0]} is stored with PREDICTOR=2"
            )

    def gdal_options(self) -> dict[str, Any]:
        """Return the options as rasterio takes them."""
        options: dict[str, Any] = {"compress": self.compress}
        if self.compress == "DEFLATE":
            options["zlevel"] = self.level or 6
        elif self.level is not None:
            options["zstd_level"] = self.level
        if self.predictor > 1:
            options["predictor"] = self.predictor
        return options | {"bigtiff": self.bigtiff, "num_threads": threads_of_gdal(self.threads)}


DEFAULT = CreationOptions()


def creation_for(
    words: Mapping[str, Any] | Iterable[str] | None, targets: Mapping[str | None, Any]
) -> CreationOptions:
    """Return the options that words name for the GeoTIFFs among some outputs; call it before the work.

    `words` are as of `CreationOptions.of`; `targets` are the outputs with the type of their pixels, None for
    those that are not asked for. A ParameterError says that the options are not allowed, do not fit a type,
    or that no output is a GeoTIFF.
    """
    creation = CreationOptions.of(words)
    if not words:
        return creation
    types = [dtype for path, dtype in targets.items() if path and Path(path).suffix.lower() in _SUFFIXES]
    if not types:
        raise ParameterError(
            "creation options (--co) are for GeoTIFF, and no output is one; name a .tif, or leave them out"
        )
    creation.check_types(*types)
    return creation


def _pairs(words: Mapping[str, Any] | Iterable[str]) -> dict[str, str]:
    """Return names and values, in capitals."""
    if isinstance(words, Mapping):
        pairs = [(str(name), _text(name, value)) for name, value in words.items()]
    else:
        pairs = [(name, value) for name, _, value in (str(word).partition("=") for word in words)]
    result: dict[str, str] = {}
    for given, value in pairs:
        name = given.strip().upper()
        if name not in ("COMPRESS", *_LEVELS, "PREDICTOR", "BIGTIFF"):
            raise ParameterError(
                f"{one_line(given)!r} is not one of the creation options COMPRESS=NAME, ZLEVEL=1..9, "
                "ZSTD_LEVEL=1..22, PREDICTOR=1|2|3 and BIGTIFF=YES|NO|IF_NEEDED|IF_SAFER"
            )
        if name in result:
            raise ParameterError(f"the creation option {name} is given twice")
        result[name] = value.strip().upper()
    return result


def _text(name: Any, value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise ParameterError(f"the value of {shown(name, False)} is a text or an integer, not {shown(value)}")
    return str(value)


def _one_of(name: str, value: str, allowed: tuple[str, ...]) -> str:
    if value not in allowed:
        which = "lossless compressions" if name == "COMPRESS" else "values"
        raise ParameterError(f"{name}={one_line(value)} is not one of the {which} {joined(allowed)}")
    return value


def _level(name: str, value: str, compress: str) -> int:
    owner, most = _LEVELS[name]
    if owner != compress:
        raise ParameterError(f"{name} is for COMPRESS={owner}, not for {compress}")
    if not (value.isascii() and value.isdecimal() and len(value) < 3 and 1 <= int(value) <= most):
        raise ParameterError(f"expected {name}=1..{most}, got {one_line(value)!r}")
    return int(value)


def _check_built(compress: str) -> None:
    """Check that GDAL was built with a compression: write one pixel."""
    if compress in _INTERNAL:
        return
    from rasterio.io import MemoryFile

    from uavseg.raster.access import opening

    how = {"driver": "GTiff", "width": 1, "height": 1, "count": 1, "dtype": "uint8", "compress": compress}
    missing = f"GDAL is built without COMPRESS={compress} here; {joined(_INTERNAL)} are there"
    refusing = caused_errors(missing, ParameterError, *opening.GDAL_ERRORS, form="{}")
    with refusing, opening.gdal_env(), MemoryFile(ext=".tif") as memory:
        opening.quiet_open(memory.name, "w", **how).close()
