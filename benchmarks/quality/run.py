"""Everybody on every scene, over two processes; what was found is remembered as long as Python runs."""

import multiprocessing
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from benchmarks.quality.methods import Method
from benchmarks.quality.metrics import Marks, marks
from benchmarks.quality.scenes import FAMILIES, Scene, draw

PROCESSES = 2  # at most
_Place = tuple[str, int]  # family and seed
_Found = tuple[Marks, float]  # and processor time


@dataclass(frozen=True, slots=True)
class Score:
    """What a method with a setting reached on one scene.

    Parameters
    ----------
    family : str
    seed : int
    method : Method
    marks : Marks
    cpu_s : float
        Processor time.
    """

    family: str
    seed: int
    method: Method
    marks: Marks
    cpu_s: float


_KNOWN: dict[tuple[_Place, tuple[str, str]], _Found] = {}


def scores(
    methods: Sequence[Method],
    seeds: int = 3,
    families: Sequence[str] = tuple(FAMILIES),
    processes: int = PROCESSES,
    tell: Callable[[str], None] = lambda line: None,
) -> list[Score]:
    """Scores of all methods on all scenes.

    Parameters
    ----------
    methods : sequence of Method
    seeds : int
        How many scenes of each family.
    families : sequence of str
        Keys of `FAMILIES`.
    processes : int
        1 stays in this process.
    tell : callable
        Told of every scene that is done.
    """
    places = [(family, seed) for family in families for seed in range(seeds)]
    jobs = [(place, [method for method in methods if (place, method.key) not in _KNOWN]) for place in places]
    jobs = [(place, missing) for place, missing in jobs if missing]
    for (place, missing), found in zip(jobs, _mapped(jobs, min(processes, PROCESSES)), strict=True):
        _KNOWN.update({(place, method.key): one for method, one in zip(missing, found, strict=True)})
        tell(f"{place[0]}, seed {place[1]}: {sum(cpu_s for _, cpu_s in found):.1f} s")
    return [Score(*place, method, *_KNOWN[place, method.key]) for place in places for method in methods]


_Job = tuple[_Place, list[Method]]


def _mapped(jobs: Sequence[_Job], processes: int) -> Iterator[list[_Found]]:
    if min(processes, len(jobs)) <= 1:
        yield from map(_found, jobs)
        return
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(_found, jobs)


def _found(job: _Job) -> list[_Found]:
    (family, seed), methods = job
    scene = draw(FAMILIES[family], seed)
    part = cache(partial(_part, scene))
    return [_marked(part(method.middle), method) for method in methods]


def _part(scene: Scene, middle: int | None) -> Scene:
    return scene if middle is None else scene.middle(middle)


def _marked(scene: Scene, method: Method) -> _Found:
    begun = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # peers warn of what they do to every scene
        found = np.asarray(method.find(scene))
    cpu_s = time.process_time() - begun
    return marks(found, scene.truth, scene.valid), cpu_s
