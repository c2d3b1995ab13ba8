"""A run that was stopped goes on where it stopped: a map that keeps each result in a folder.

In the folder, each stage of the work (one function with its arguments: the rasters, how they are read, the
stretch) has a folder of its own, and each tile a file in it. Both are named by a hash of everything that the
result depends on, so whatever changes (a raster, an option, the size of the tiles, the program itself) leads
to other files, and nothing stale is ever taken up. What another run needs too is shared: a second range finds
the rasters measured.
"""

import hashlib
import os
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from uavseg._version import __version__
from uavseg.atomic import whole_file
from uavseg.errors import OutputError
from uavseg.execution.executors import Item, Map, Progress, Result
from uavseg.execution.fingerprint import fingerprint
from uavseg.execution.lazy_sequence import lazy_selection
from uavseg.execution.result_file import DamagedResultError, dump, load

Tell = Callable[[str, int, int], object]
"""Told the name of a stage, how many of its tiles were done before, and of how many."""


def kept(map: Map, folder: str | os.PathLike[str], tell: Tell | None = None) -> Map:
    """A map that keeps every finished result in a folder, and takes from there what is finished.

    Results are read, and written as they come back, by whoever asks for them; only what is missing is given
    to the other map. A file appears whole or not at all; one that was damaged since is made again. The
    folder stays as it is in the end: it may be used again, and may be removed.

    Parameters
    ----------
    map : Map
        Who runs the work.
    folder : path
        Made if it is not there; the folder that it lies in is.
    tell : callable, optional
        Called once for each stage of which some tiles were done before.

    Raises
    ------
    OutputError
        If the folder cannot be made, or a result cannot be written there.
    """
    place = Path(folder)
    _make(place)

    def run(
        function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
    ) -> Generator[Result, None, None]:
        name = stage_name(function)
        stage = place / f"{name}-{fingerprint(__version__, _code(), function)}"
        _make(stage)
        keys = [fingerprint(item) for item in items]
        there = {path.name for path in stage.iterdir()}
        missing = [k for k, key in enumerate(keys) if _file_name(key) not in there]
        if tell is not None and len(missing) < len(keys):
            tell(name, len(keys) - len(missing), len(keys))
        waiting = set(missing)
        with closing(
            map(function, lazy_selection(items, missing))
        ) as fresh:  # nobody works on once this has ended
            for k, key in enumerate(keys):
                if k in waiting:
                    result = next(fresh)
                    _save(stage, key, result)
                else:
                    result = _taken(stage, key, partial(map, function, lazy_selection(items, [k])))
                yield result
                if progress is not None:
                    progress(k + 1, len(keys))

    return run


def stage_name(function: Any) -> str:
    """What a function does, for people: `_measure_tile` of whatever arguments is "measure"."""
    while not hasattr(function, "__name__"):
        inner = getattr(function, "func", None) or getattr(function, "function", None)
        if inner is None:
            return type(function).__name__.strip("_").lower()
        function = inner
    return str(function.__name__).strip("_").removesuffix("_tile")


@lru_cache
def _code() -> str:
    """A hash of the program's own text: between two releases, the version alone does not tell them apart."""
    hasher = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        hasher.update(path.read_bytes())
    return hasher.hexdigest()


def _file_name(key: str) -> str:
    return f"{key}.npz"


def _make(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        reason = "it is a file" if folder.exists() else error.strerror
        raise OutputError(f"the folder {folder} to resume from cannot be made: {reason}") from error


def _save(stage: Path, key: str, result: Any) -> None:
    """Write a result; not synced, since one that a power cut tears is found damaged and made again."""
    with whole_file(stage / _file_name(key), overwrite=True, sync=False) as path:
        path.write_bytes(dump(result, key))


def _taken(stage: Path, key: str, again: Callable[[], Iterator[Any]]) -> Any:
    """A result from its file; where that is damaged, made again."""
    try:
        return load((stage / _file_name(key)).read_bytes(), key)
    except (OSError, DamagedResultError):
        [result] = again()
        _save(stage, key, result)
        return result
