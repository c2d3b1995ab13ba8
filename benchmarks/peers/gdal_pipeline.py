"""GDAL 3.12 and later in one process: `gdal pipeline`, which streams a range of values to polygons.

The program itself is in no package for Python; its algorithms are in the library that pyogrio brings. The
library alone is loaded, as the program does. RASTER has one band.

Usage: python gdal_pipeline.py RASTER OUTPUT LOW HIGH MIN_PIXELS
"""

import ctypes
import os
import sys
from importlib.util import find_spec
from pathlib import Path


def library() -> Path | None:
    """Find the library of GDAL that pyogrio brings, without an import of it."""
    spec = find_spec("pyogrio")
    if spec is None or spec.origin is None:
        return None
    return next((Path(spec.origin).parents[1] / "pyogrio.libs").glob("libgdal*"), None)


def main(raster: str, output: str, low: str, high: str, min_pixels: str) -> None:
    """Polygonise a range of values."""
    path = library()
    assert path is not None
    data = path.parents[1] / "pyogrio"
    os.environ |= {"GDAL_DATA": str(data / "gdal_data"), "PROJ_DATA": str(data / "proj_data")}
    gdal = ctypes.CDLL(str(path))
    pointer, text = ctypes.c_void_p, ctypes.c_char_p
    gdal.GDALGetGlobalAlgorithmRegistry.restype = pointer
    gdal.GDALAlgorithmRegistryInstantiateAlg.restype = pointer
    gdal.GDALAlgorithmRegistryInstantiateAlg.argtypes = [pointer, text]
    gdal.GDALAlgorithmParseCommandLineArguments.argtypes = [pointer, ctypes.POINTER(text)]
    gdal.GDALAlgorithmRun.argtypes = [pointer, pointer, pointer]
    gdal.GDALAlgorithmFinalize.argtypes = [pointer]
    gdal.CPLGetLastErrorMsg.restype = text
    gdal.GDALAllRegister()
    algorithm = gdal.GDALAlgorithmRegistryInstantiateAlg(gdal.GDALGetGlobalAlgorithmRegistry(), b"pipeline")
    steps = (
        f"read {raster} ! reclassify -m [{low},{high}]=1;DEFAULT=0 --ot Byte ! sieve -s {min_pixels} "
        f"! edit --nodata 0 ! polygonize ! write {output}"
    )
    arguments = (text * 2)(steps.encode(), None)
    done = gdal.GDALAlgorithmParseCommandLineArguments(algorithm, arguments)
    done = done and gdal.GDALAlgorithmRun(algorithm, None, None) and gdal.GDALAlgorithmFinalize(algorithm)
    if not done & 1:
        sys.exit(gdal.CPLGetLastErrorMsg().decode())


if __name__ == "__main__":
    main(*sys.argv[1:])
