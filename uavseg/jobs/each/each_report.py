"""Outcomes of one job over many sources, and their table as CSV."""

import csv
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from uavseg.dataclass import dataclass
from uavseg.errors import OutputError
from uavseg.output.atomic import atomic_file, check_target

_HEADER = ("source", "output", "regions", "area_m2", "warnings", "error")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came out of one source: how many regions, or the error why there are none.

    `area_m2` is their total area, in the units of the raster where it has no CRS.
    """

    source: str
    output: str
    regions: int | None = None
    area_m2: float | None = None
    warnings: tuple[str, ...] = ()
    error: str | None = None

    @property
    def failure(self) -> str:
        """The error as one clause that names the source."""
        text = self.error or ""
        return text if text.startswith(f"{self.source} ") else f"{self.source} failed: {text}"


def check_report(path: str, outputs: Iterable[str], overwrite: bool = False) -> None:
    """Check that a report may be written, before the work.

    `outputs` are the other files of the run. An OutputError says that it is not a .csv, exists and may not be
    replaced, or has the name of an output.
    """
    if Path(path).suffix.lower() != ".csv":
        raise OutputError(f"{path}: a report is written to .csv")
    check_target(path, overwrite)
    if os.path.realpath(path) in {os.path.realpath(name) for name in outputs}:
        raise OutputError(f"{path} is an output and the report; give each a name of its own")


def write_report(outcomes: Sequence[Outcome], path: str, overwrite: bool = False) -> None:
    """Write what came out of each source as CSV (RFC 4180, UTF-8).

    The columns are source, output, regions, area_m2, warnings (separated by "; ") and error. It says nothing
    of the time a source took, so that the same run gives the same bytes. An OutputError says that it cannot
    be written.
    """
    with (
        atomic_file(path, overwrite) as part,
        part.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file,
    ):
        table = csv.writer(file)
        table.writerow(_HEADER)
        for one in outcomes:
            area = None if one.area_m2 is None else float(f"{one.area_m2:.12g}")
            table.writerow((one.source, one.output, one.regions, area, "; ".join(one.warnings), one.error))
