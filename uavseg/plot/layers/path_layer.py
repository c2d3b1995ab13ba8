"""A path in a picture: its line in white, where it begins and where it ends."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import PathError
from uavseg.occupancy.paths.find_path import Way
from uavseg.plot.frame import Frame

LINE, CASING = "#ffffff", "#111111"
START, GOAL = "#37b24d", "#f03e3e"
MISSIONS = (".plan", ".waypoints")

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PathLayer:
    """A path on the sheet.

    Parameters
    ----------
    lines : tuple of (n, 2) float64 arrays
        One, or several where the antimeridian cuts it.
    length_m : float or None
        As its file tells it.
    """

    lines: tuple[Floats, ...]
    length_m: float | None

    @classmethod
    def of(cls, source: "Way | str | os.PathLike[str]", frame: Frame) -> "PathLayer":
        """A path that `uavseg path` found or wrote, as GeoJSON or as a mission, brought to the sheet.

        Raises
        ------
        PathError
            If the file cannot be read or holds no line.
        """
        if isinstance(source, Way):
            return cls((frame.sheet_from_xy(source.xy),), source.length_m)
        if Path(source).suffix.lower() in MISSIONS:
            return cls((_flown(source, frame),), None)
        lines, length = _read(Path(source))
        if frame.geobox.crs is None:
            return cls(tuple(frame.sheet_from_xy(line) for line in lines), length)
        if any(np.abs(line).max() > 180 for line in lines):
            raise PathError(f"{source} has local coordinates, and this raster has a place on Earth")
        return cls(tuple(frame.sheet_from_lonlat(*line.T) for line in lines), length)

    def told(self, on_globe: bool) -> list[str]:
        """How long it is."""
        unit = " m" if on_globe else ""
        return ["path" if self.length_m is None else f"path of {self.length_m:,.5g}{unit}"]

    def draw(self, ax: Any, unit: float) -> None:
        """Draw on axes, where `unit` is the length on the sheet of one point (1/72 inch)."""
        for line in self.lines:
            ax.plot(*line.T, color=CASING, lw=3.2, alpha=0.8, solid_joinstyle="round", zorder=4.8)
            ax.plot(*line.T, color=LINE, lw=1.6, solid_joinstyle="round", zorder=4.9)
        ends = {"start": (self.lines[0][0], START, "o"), "goal": (self.lines[-1][-1], GOAL, "D")}
        for name, (place, color, marker) in ends.items():
            ax.scatter(
                *place, s=48, marker=marker, color=color, edgecolor=LINE, lw=1.1, zorder=4.95, label=name
            )


def _flown(source: str | os.PathLike[str], frame: Frame) -> Floats:
    from uavseg.flight import files
    from uavseg.flight.items import WAYPOINT

    places = [item for item in files.read(source).items if item.command == WAYPOINT]
    if not places:
        raise PathError(f"{source} has no waypoints, so there is no path to draw")
    return frame.sheet_from_lonlat([item.lon for item in places], [item.lat for item in places])


def _read(source: Path) -> tuple[list[Floats], float | None]:
    """The lines of a GeoJSON file, and the length that it tells."""
    try:
        [feature] = json.loads(source.read_text(encoding="utf-8"))["features"]
        shape = feature["geometry"]
        parts = {"LineString": [shape["coordinates"]], "MultiLineString": shape["coordinates"]}[shape["type"]]
        lines = [np.array(part, np.float64).reshape(-1, 2) for part in parts]
        length = feature["properties"].get("length_m")
        return lines, None if length is None else float(length)
    except OSError as error:
        raise PathError(
            f"{source} cannot be read ({error.strerror}); uavseg path makes such a file"
        ) from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise PathError(f"{source} holds no line of a path; uavseg path makes such a file") from error
