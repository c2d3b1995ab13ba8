"""Import of pyarrow, an optional dependency for GeoParquet."""

from typing import Any

from uavseg.errors import MissingLibraryError


def import_pyarrow() -> Any:
    """Return pyarrow with its Parquet module; raise a MissingLibraryError where it is not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "pyarrow":
            raise
        raise MissingLibraryError(
            "GeoParquet needs pyarrow, which is not installed; install it with: "
            'pip install "uavseg[parquet]", or choose another format, such as .gpkg'
        ) from error
    return pyarrow
