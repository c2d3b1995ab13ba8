"""One case of the campaign: files, and the commands or the Python call that are run on them."""

from dataclasses import dataclass, field
from random import Random

Arguments = tuple[str, ...]


@dataclass(frozen=True)
class Call:
    """A call of a public function of `uavseg`, with the names of the values that `arguments` knows.

    Parameters
    ----------
    function : str
        Such as "extract" or "OccupancyGrid.update".
    given : dict of str to str
        Name of a value by name of a parameter.
    """

    function: str
    given: dict[str, str]


@dataclass(frozen=True)
class Case:
    """What is run.

    Parameters
    ----------
    files : dict of str to bytes
        Content by name, in the folder in which the case runs.
    commands : tuple of tuples of str
        Command lines without the word `uavseg`, one after the other.
    targets : tuple of str
        What names of files that a command may make begin with.
    same : bool
        Whether all commands say the same and write the same bytes (the first target with the number of
        the command, `o0.geojson` and `o1.geojson`).
    stdin : bytes
    call : Call, optional
        A call of Python instead of commands.
    """

    files: dict[str, bytes]
    commands: tuple[Arguments, ...] = ()
    targets: tuple[str, ...] = ("out",)
    same: bool = False
    stdin: bytes = b""
    call: Call | None = None
    environment: dict[str, str] = field(default_factory=dict)


def chosen(rng: Random, share: float) -> bool:
    """True with this probability."""
    return rng.random() < share
