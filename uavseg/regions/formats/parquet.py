"""pyarrow, which GeoParquet needs and which is installed with an extra."""

from typing import Any

from uavseg.errors import MissingLibraryError


def import_pyarrow() -> Any:
    """The library with its Parquet part.

    Raises
    ------
    MissingLibraryError
        If it is not installed.
    """
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
