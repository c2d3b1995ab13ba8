"""Exception hierarchy: one class for each kind of error that the user can correct.

Each message says what is wrong, what was expected and what to do; the command line prints it as it is. It is
one printable line: a name or a text of a file in it cannot change what a terminal shows.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from uavseg.plain_text import cause_of, one_line

OUT_OF_MEMORY = "out of memory; smaller tiles (--tile 1024) or fewer --threads need less"


class UavsegError(Exception):
    """Base class: an error that the user can correct.

    Control characters in its message are escaped, and the middle of a long one is left out.
    """

    exit_code = 1
    """With which a command ends."""

    def __init__(self, message: str = "") -> None:
        super().__init__(one_line(message))


class ParameterError(UavsegError, ValueError):
    """A parameter is out of its domain."""


class IntensityRangeError(ParameterError):
    """An intensity range is reversed, or leaves [0, 1]."""


class RasterError(UavsegError, ValueError):
    """A raster is of an unsupported kind."""


class RasterReadError(UavsegError, OSError):
    """A raster cannot be opened, or its pixels cannot be read."""


class AccessError(UavsegError, PermissionError):
    """The content of a file names another file or an address that may not be opened."""


class BandError(ParameterError):
    """No band has a name, several have it, or a choice among bands is missing."""


class UnchosenBandsError(BandError):
    """A raster has so many bands that the user has to choose."""


class ExpressionError(BandError):
    """Band arithmetic cannot be computed; the message points at the place."""


class MosaicError(RasterError):
    """Rasters do not fit together as one mosaic."""


class MapError(RasterError):
    """An occupancy map, or the metadata for reading it, is invalid."""


class LostObstaclesError(MapError):
    """A classification would leave out obstacles of the map: structures without an occupied cell."""


class SceneError(UavsegError, ValueError):
    """A scene cannot be simulated: its shapes, its sensor or a pose of the sensor is invalid."""


class BagError(UavsegError, ValueError):
    """A recorded bag cannot be read, or lacks the scans or poses that a map needs."""


class RegionError(UavsegError, ValueError):
    """Regions are missing, empty or invalid."""


class SampleError(UavsegError, ValueError):
    """A texture sample lies outside the raster, or is too small, too large or empty."""


class PathError(UavsegError, ValueError):
    """No path exists between the two places, or a path cannot be read."""


class ClusterError(UavsegError, OSError):
    """A scheduler or its workers cannot be reached, are lost, or have other versions than the client."""


class MissionError(UavsegError, ValueError):
    """A mission would be unsafe, or its reader would refuse it."""


class PhotographError(UavsegError, ValueError):
    """A photograph from the air does not say where it was taken, or shows no ground."""


class LinkError(UavsegError, OSError):
    """A vehicle cannot be reached, refuses a mission, falls silent, or is not alone on its link."""


class UnverifiedError(LinkError):
    """A vehicle accepted a mission, which could then not be read back and compared."""

    exit_code = 3


class OutputError(UavsegError, OSError):
    """An output file cannot be written."""


class OutputExistsError(OutputError):
    """An output file exists already, and may not be replaced."""


class MissingLibraryError(UavsegError, ImportError):
    """An optional library is not installed."""


@contextmanager
def named_errors(
    what: object, caught: type[Exception], raised: type[Exception] | None = None
) -> Iterator[None]:
    """Enter a block whose errors say first what they are about; they are raised as another kind if given."""
    try:
        yield
    except caught as error:
        raise (raised or type(error))(f"{what}: {error}") from error


@contextmanager
def caused_errors(
    text: str, raised: Callable[[str], Exception], *caught: type[Exception], form: str = "{} ({})"
) -> Iterator[None]:
    """Enter a block in which errors of libraries are raised as one that tells this, and their cause.

    Those that the user can correct stay as they are. With the form "{}" the cause is not told.
    """
    try:
        yield
    except UavsegError:
        raise
    except caught as error:
        raise raised(form.format(text, cause_of(error))) from error
