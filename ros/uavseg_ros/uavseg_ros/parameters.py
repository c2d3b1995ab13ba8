"""Parameters of the node: names, defaults, descriptions and checks in one table."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from uavseg import IntensityRange, StateLimits
from uavseg.errors import ParameterError
from uavseg.occupancy.paths.find_path import PathParams


def _parameter(default: Any, description: str) -> Any:
    return field(default=default, metadata={"description": description})


@dataclass(frozen=True)
class NodeParams:
    """Parameters of the node, by name; wrong values raise ParameterError."""

    base_frame: str = _parameter("base_link", "Frame of the robot; its origin is the start of paths.")
    map_transient_local: bool = _parameter(
        True, "Whether the map's publisher is transient local (latched); false for one that is volatile."
    )
    free_below: float = _parameter(0.498, "A cell is free up to this probability.")
    occupied_above: float = _parameter(0.502, "A cell is occupied above this probability.")
    min_object_cells: int = _parameter(0, "Objects of fewer cells are not published; states do not change.")
    passable_below: float = _parameter(0.45, "A path enters cells up to this probability.")
    clearance: float = _parameter(0.2, "Metres from the centres of a path's cells to all that is impassable.")
    smooth: bool = _parameter(True, "Whether a path is pulled tight, at any angle.")
    path_spacing: float = _parameter(0.05, "Metres between poses of a path, at most; 0: corners alone.")
    replan: bool = _parameter(True, "Whether a path is planned again when the map changes.")
    transform_tolerance: float = _parameter(1.0, "Age in seconds above which a transform counts as missing.")
    update_period: float = _parameter(
        0.5, "Seconds after which updates, and goals without tf, are looked at."
    )

    def __post_init__(self) -> None:
        for one in fields(self):
            object.__setattr__(self, one.name, _typed(one.name, getattr(self, one.name), one.default))
        if not self.base_frame:
            raise ParameterError("base_frame is the name of a frame, such as base_link, not empty")
        _ = self.limits, self.passable, PathParams(self.clearance, self.smooth)
        if self.min_object_cells < 0:
            raise ParameterError(f"min_object_cells is not negative, not {self.min_object_cells}")
        if not (self.path_spacing == 0 or 0.001 <= self.path_spacing < math.inf):
            raise ParameterError(f"path_spacing is 0 or at least 0.001 m, not {self.path_spacing:g}")
        for name in ("transform_tolerance", "update_period"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ParameterError(f"{name} is a number of seconds above 0, not {getattr(self, name):g}")

    @property
    def limits(self) -> StateLimits:
        """Return the limits of the states."""
        return StateLimits(self.free_below, self.occupied_above)

    @property
    def passable(self) -> IntensityRange:
        """Return the range of probabilities that a path enters."""
        return IntensityRange(0.0, self.passable_below)


def descriptions() -> Mapping[str, tuple[Any, str]]:
    """Return default and description of each parameter, by name."""
    return {one.name: (one.default, one.metadata["description"]) for one in fields(NodeParams)}


def _typed(name: str, value: Any, default: Any) -> Any:
    """Return a value as the type of its default; a whole number is a float too."""
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not type(default):
        kinds = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
        raise ParameterError(f"{name} is {kinds[type(default)]}, not {value!r}")
    return value
