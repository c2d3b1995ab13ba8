"""What can go wrong, one class for each kind of wrong.

Every message says what was wrong, what was expected and what to do; the command line prints it as it is.
"""


class UavsegError(Exception):
    """Something the user can mend; the message says how."""


class ParameterError(UavsegError, ValueError):
    """A parameter lies outside what it may be."""


class IntensityRangeError(ParameterError):
    """A range of intensity is upside down or leaves [0, 1]."""


class RasterError(UavsegError, ValueError):
    """A raster is of a kind that cannot be answered rightly."""


class RasterReadError(UavsegError, OSError):
    """A raster cannot be opened or its pixels cannot be read."""


class MosaicError(RasterError):
    """Rasters that were given together do not fit together."""


class MapError(RasterError):
    """A map of probabilities, or what says how to read it, is not what it should be."""


class SceneError(UavsegError, ValueError):
    """A scene to be simulated cannot be: its shapes, its sensor or where the sensor stands."""


class RegionError(UavsegError, ValueError):
    """Regions are missing, empty or not what was asked for."""


class SampleError(UavsegError, ValueError):
    """A sample of texture is not where the raster is, is too small, or is none."""


class PathError(UavsegError, ValueError):
    """No path leads where it is wanted."""


class ClusterError(UavsegError, OSError):
    """A scheduler or its workers cannot be reached, are lost, or differ from this installation."""


class MissionError(UavsegError, ValueError):
    """A mission would not be safe, or a reader would refuse it."""


class OutputError(UavsegError, OSError):
    """An output cannot be written where it was asked for."""


class OutputExistsError(OutputError):
    """An output is there already, and nobody allowed to replace it."""
