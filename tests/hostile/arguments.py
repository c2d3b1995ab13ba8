"""Cases of Python: each public function with one argument of a wrong kind or value."""

import inspect
import sys
import traceback
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any

import numpy as np

from tests.hostile import seeds
from tests.hostile.case import Call, Case, chosen
from tests.hostile.serving import visit
from tests.occupancy.mapping.test_point_cloud import cloud

LONGEST = 600


class Hostile:
    """An object that says nothing of itself."""

    def __repr__(self) -> str:
        return "<Hostile\n\x1b[31m>"


VALUES: dict[str, Callable[[], Any]] = {
    "none": lambda: None,
    "true": lambda: True,
    "zero": lambda: 0,
    "one": lambda: 1,
    "minus": lambda: -1,
    "huge": lambda: 10**400,
    "large": lambda: 2**63,
    "half": lambda: 0.5,
    "float": lambda: 64.0,
    "nan": lambda: float("nan"),
    "inf": lambda: float("inf"),
    "minus inf": lambda: -float("inf"),
    "large float": lambda: 1e308,
    "tiny": lambda: 1e-320,
    "complex": lambda: 1j,
    "empty text": lambda: "",
    "text": lambda: "abc",
    "number text": lambda: "5",
    "control text": lambda: "a\x1b[31m\nb",
    "long text": lambda: "a" * 5000,
    "surrogate": lambda: "\udcff.tif",
    "zero byte": lambda: "a\0b",
    "bytes": lambda: b"abc",
    "empty tuple": lambda: (),
    "single": lambda: (1,),
    "pair": lambda: (0.2, 0.8),
    "triple": lambda: (1, 2, 3),
    "pair of texts": lambda: ("a", "b"),
    "pair of none": lambda: (None, None),
    "pair of nan": lambda: (float("nan"), float("nan")),
    "nested": lambda: ((1, 2), (3, 4)),
    "list": lambda: [1, 2],
    "empty list": list,
    "dict": dict,
    "set": lambda: {1, 2},
    "generator": lambda: (n for n in (1, 2)),
    "object": object,
    "hostile": Hostile,
    "class": lambda: int,
    "function": lambda: len,
    "path": lambda: Path("none.tif"),
    "vector": lambda: np.zeros(3),
    "scalar": lambda: np.float64(0.5),
    "cells": lambda: np.zeros((4, 5)),
    "cube": lambda: np.zeros((2, 3, 4)),
    "no cells": lambda: np.zeros((0, 0)),
    "texts": lambda: np.array([["a", "b"]]),
    "objects": lambda: np.array([[None, 1]], dtype=object),
    "nans": lambda: np.full((3, 3), np.nan),
    "complexes": lambda: np.zeros((3, 3), complex),
    "bools": lambda: np.zeros((3, 3), bool),
    "dates": lambda: np.zeros((3, 3), "datetime64[s]"),
    "integers": lambda: np.arange(12).reshape(3, 4),
}


def _field() -> Any:
    return seeds.image(64, 96)


def _map() -> Any:
    return np.where(seeds.image(64, 64) > 100, 0.9, 0.1)


def _geobox() -> Any:
    from affine import Affine

    import uavseg

    return uavseg.GeoBox((20, 30), Affine(0.1, 0, 0, 0, -0.1, 2), None)


def _scan(pose: Any = None) -> Any:
    import uavseg

    angles = np.linspace(-0.5, 0.5, 11)
    return uavseg.Scan(pose or uavseg.Pose(0.5, 0.5), angles, np.full(11, 1.0), 2.0, 0.05)


def _laserscan() -> Any:
    numbers = {
        "angle_min": -0.5,
        "angle_max": 0.5,
        "angle_increment": 0.1,
        "range_min": 0.0,
        "range_max": 2.0,
    }
    return SimpleNamespace(ranges=[1.0] * 11, **numbers)


def _grid() -> Any:
    import uavseg

    grid = uavseg.OccupancyGrid.empty((20, 30), 0.1)
    grid.update(_scan())
    return grid


def _dataset() -> Any:
    import uavseg

    return uavseg.Dataset.of_values(_field(), uavseg.GeoBox((64, 96), _geobox().transform, None), "field")


def _extract() -> Any:
    import uavseg

    return uavseg.extract


def _window() -> Any:
    from uavseg.raster.grid.tiling import Window

    return Window(2, 3, 4, 5)


BASES: dict[str, Callable[[], dict[str, Any]]] = {
    "extract": lambda: {"source": _field(), "range": (0.4, 1), "threads": 1},
    "levels": lambda: {"source": _field(), "width": 0.3, "threads": 1},
    "divide": lambda: {"source": _dataset(), "threads": 1},
    "classify": lambda: {"source": _map(), "threads": 1},
    "describe": lambda: {"source": _map(), "threads": 1},
    "recognise": lambda: {"source": _map(), "library": "r.gpkg", "learn": "disc", "ids": [1], "threads": 1},
    "path": lambda: {
        "source": _map(),
        "range": (0, 0.5),
        "start": (1.5, 1.5),
        "goal": (4.5, 3.5),
        "threads": 1,
    },
    "next_views": lambda: {"source": _map(), "pose": (1.5, 1.5), "range": 3.0, "threads": 1},
    "explore": lambda: {"scene": "lens", "range": 0.5, "step": 5.0},
    "match": lambda: {"source": seeds.image(128, 140), "like": (64.0, 64.0, 40.0), "threads": 1},
    "suggest": lambda: {"source": _field(), "threads": 1},
    "suggest like": lambda: {"source": seeds.image(128, 140), "like": (64.0, 64.0, 20.0), "threads": 1},
    "extract_to": lambda: {"output": "out.parquet", "source": _field(), "range": (0.4, 1), "threads": 1},
    "each": lambda: {
        "job": _extract(),
        "sources": "x.tif",
        "output": "out-{stem}.geojson",
        "range": (0.4, 1),
        "threads": 1,
    },
    "plan": lambda: {"regions": "hand.geojson", "altitude": 50, "home": "auto"},
    "check": lambda: {"mission": "fly.plan"},
    "footprints": lambda: {"photographs": "p.jpg"},
    "resume": lambda: {"mission": "fly.plan", "start": 4.5},
    "georeference": lambda: {"photographs": "p.jpg", "output": "out.tif"},
    "upload": lambda: {"mission": "fly.plan", "connect": "tcp:127.0.0.1:9"},
    "download": lambda: {"connect": "tcp:127.0.0.1:9"},
    "warm_up": lambda: {"processes": 1},
    "preview": lambda: {"source": "x.tif", "output": "out.png", "width": 300},
    "map_page": lambda: {"source": "x.tif", "output": "out.html", "size": 64},
    "serve": lambda: {"source": "x.tif", "size": 64, "threads": 1},
    "info": lambda: {"source": "x.tif"},
    "trace": lambda: {"labels": np.kron(np.eye(3, dtype=np.uint32), np.ones((4, 4), np.uint32))},
    "PlanParams": lambda: {"altitude_m": 50.0},
    "GeoBox": lambda: {"shape": (3, 4), "transform": _geobox().transform, "crs": None},
    "IntensityRange": lambda: {"low": 0.1, "high": 0.9},
    "StateLimits": dict,
    "build_map": lambda: {"bag": "none.bag"},
    "compare": lambda: {"before": _field(), "after": _field(), "range": (0.4, 1), "threads": 1},
    "merge_maps": lambda: {"maps": ["x.tif"], "crop": True},
    "mask": lambda: {"regions": "hand.geojson", "map": _map(), "speed": 40},
    "Pose.from_quaternion": lambda: {"x": 0.0, "y": 0.0, "quaternion": (0, 0, 0, 1)},
    "Scan.from_laserscan": lambda: {"message": _laserscan(), "pose": _scan().pose},
    "Scan.from_point_cloud": lambda: {
        "message": cloud([[1.0, 2.0, 0.5], [2.0, 0.0, 3.0]]),
        "pose": _scan().pose,
        "heights": (0.1, 1.8),
    },
    "OccupancyGrid.from_message": lambda: {"message": _grid().to_message()},
    "OccupancyGrid.load": lambda: {"path": "x.tif"},
    "Pose": lambda: {"x": 0.0, "y": 0.0},
    "Scan": lambda: {
        "pose": _scan().pose,
        "angles": np.zeros(3),
        "ranges": np.ones(3),
        "max_range_m": 2.0,
        "sigma_m": 0.1,
    },
    "Dataset.open": lambda: {"sources": "x.tif"},
    "Dataset.of_values": lambda: {"values": _field(), "geobox": _dataset().geobox, "name": "field"},
    "OccupancyGrid": lambda: {"geobox": _geobox()},
    "OccupancyGrid.empty": lambda: {"shape": (20, 30), "cell_m": 0.1},
    "OccupancyGrid.from_probabilities": lambda: {
        "probabilities": np.full((20, 30), 0.4),
        "geobox": _geobox(),
    },
}
METHODS = {"OccupancyGrid.": _grid, "Dataset.": _dataset, "GeoBox.": _geobox}


@cache
def functions() -> dict[str, tuple[str, ...]]:
    """Parameters of each public function, class and method, by its name."""
    import uavseg

    found: dict[str, tuple[str, ...]] = {}
    for name in uavseg.__all__:
        value = getattr(uavseg, name)
        if isinstance(value, str) or (inspect.isclass(value) and issubclass(value, Exception)):
            continue
        if name == "RangeWidget":  # its methods are those of a library
            continue
        if not (inspect.isclass(value) and name == "Dataset"):
            found[name] = _parameters(value)
        if inspect.isclass(value):
            for method, member in inspect.getmembers(value):
                if not method.startswith("_") and callable(member):
                    found[f"{name}.{method}"] = _parameters(member)
    return {name: parameters for name, parameters in found.items() if parameters}


def _parameters(function: Any) -> tuple[str, ...]:
    return tuple(name for name in inspect.signature(function).parameters if name != "self")


def case(rng: Random) -> Case:
    """A call with one argument replaced, at times two."""
    name = rng.choice(sorted(functions()))
    given = {rng.choice(functions()[name]): rng.choice(list(VALUES))}
    if chosen(rng, 0.15):
        given[rng.choice(functions()[name])] = rng.choice(list(VALUES))
    files = {"x.tif": seeds.rasters()["deflate.tif"]}
    if name in {"footprints", "georeference", "check"}:
        files["p.jpg"] = seeds.photographs()["p.jpg"]
    if name == "plan":
        files["hand.geojson"] = seeds.vectors()["hand.geojson"]
    if name in {"upload", "check", "resume"}:
        files["fly.plan"] = seeds.missions()["a.plan"]
    return Case(files, call=Call(name, given))


def perform(call: Call) -> None:
    """Make a call; says on stderr what was wrong with the way in which it failed."""
    import uavseg
    from uavseg.errors import UavsegError

    function, arguments = _bound(call.function)
    arguments |= {name: VALUES[value]() for name, value in call.given.items()}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            made = function(**arguments)
            if call.function == "serve":
                with made:
                    visit(made)
        except (TypeError, ValueError, OSError, UavsegError) as error:
            _check(error, call, Path(uavseg.__file__).parent)
        except Exception as error:
            _say("RAWERROR", call, error)
    for warning in caught:
        of_affine = "`@` matmul" in str(
            warning.message
        )  # affine 3 asks for `@`, which affine 2 does not have
        if warning.category is not UserWarning and not of_affine:
            print(
                f"#PYWARN# {call.function} {warning.category.__name__}: {str(warning.message)!r}",
                file=sys.stderr,
            )


def _bound(name: str) -> tuple[Any, dict[str, Any]]:
    """A function and arguments with which it works."""
    import uavseg

    first, _, method = name.partition(".")
    owner = getattr(uavseg, first)
    if not method:
        return owner, BASES[name]()
    if name in BASES:
        return getattr(owner, method), BASES[name]()
    made = METHODS[f"{first}."]() if f"{first}." in METHODS else owner(**BASES[first]())
    return getattr(made, method), METHOD_ARGUMENTS.get(name, dict)()


METHOD_ARGUMENTS: dict[str, Callable[[], dict[str, Any]]] = {
    "OccupancyGrid.update": lambda: {"scan": _scan()},
    "OccupancyGrid.merge": lambda: {"scan": _scan()},
    "OccupancyGrid.save": lambda: {"path": "out.tif"},
    "Dataset.of_band": lambda: {"band": 1},
    "Dataset.read": lambda: {"window": _window()},
    "Dataset.is_empty": lambda: {"window": _window()},
    "Dataset.read_coarse": lambda: {"max_side": 20},
    "GeoBox.window": lambda: {"window": _window()},
    "StateLimits.of": lambda: {"v": 0.3},
    "GeoBox.xy_from_pixel": lambda: {"row": 1.0, "col": 2.0},
    "GeoBox.lonlat_from_xy": lambda: {"x": 1.0, "y": 2.0},
    "GeoBox.coarsen": lambda: {"side": 2},
}


def _check(error: Exception, call: Call, package: Path) -> None:
    """An error that the user can correct is a sentence of ours that names what was wrong."""
    from uavseg.errors import UavsegError

    text = str(error)
    of_disc = ("int() argument must be", "object of type 'Disc' has no len()")
    if text.startswith(("len() takes", "int() can't convert", "int() base must be", *of_disc)) and {
        "function",
        "class",
    } & {*call.given.values()}:
        return  # of the caller's own function, as it is
    where = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)]
    if len(text) > LONGEST or not text.isprintable():
        _say("BADTEXT", call, error)
    elif isinstance(error, UavsegError):
        return
    elif package not in where[-1].parents or not any(name in text for name in call.given):
        _say("RAWERROR", call, error)


def _say(kind: str, call: Call, error: BaseException) -> None:
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "/uavseg/" in frame.filename]
    place = f"{own[-1].filename.rpartition('/uavseg/')[2]}:{own[-1].name}" if own else ""
    text = " ".join(ascii(str(error)).split())[:200]
    print(f"#{kind}# {call.function} {call.given} {type(error).__name__} @ {place}: {text}", file=sys.stderr)
