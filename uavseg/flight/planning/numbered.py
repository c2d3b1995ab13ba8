"""Mission files of several flights: survey-1.plan, survey-2.plan, and so on."""

import warnings
from collections.abc import Sequence
from pathlib import Path

from uavseg.flight.formats.files import MissionPath, write_mission
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission.mission import Mission
from uavseg.flight.safety.check import SafetyCheck
from uavseg.output.atomic import transaction


def _flight_paths(path: MissionPath, count: int) -> list[Path]:
    """Return the file of each flight: the path itself for one.

    >>> [path.name for path in _flight_paths("survey.plan", 2)]
    ['survey-1.plan', 'survey-2.plan']
    """
    base = Path(path)
    if count == 1:
        return [base]
    return [base.with_name(f"{base.stem}-{number}{base.suffix}") for number in range(1, count + 1)]


def write_flights(
    missions: Sequence[Mission],
    path: MissionPath,
    check: SafetyCheck,
    overwrite: bool = False,
    options: FileOptions | None = None,
) -> list[Path]:
    """Write missions, read each back and check it; all files appear together, or none.

    `path` is the file of a single mission, see `_flight_paths`. A MissionError says that its extension is not
    one of missions, or that what was written is not safe, an OutputError that a file exists or cannot be
    written.
    """
    paths = _flight_paths(path, len(missions))
    options = options or FileOptions()
    stale = _stale_flight(path, len(missions))
    with transaction():
        for mission, one in zip(missions, paths, strict=True):
            write_mission(
                mission, one, overwrite, check.check, editable=options.editable, dji_model=options.dji_model
            )
    if stale is not None:
        warnings.warn(f"{stale} is of another plan; do not fly it with this one", stacklevel=2)
    return paths


def _stale_flight(path: MissionPath, count: int) -> Path | None:
    """Return a file of another plan that looks like one more flight of this one."""
    base = Path(path)
    following = base.with_name(f"{base.stem}-{count + 1 if count > 1 else 1}{base.suffix}")
    files = (following, base) if count > 1 else (following,)
    return next((file for file in files if file.exists()), None)
