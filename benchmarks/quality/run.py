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
_Key = tuple[str, int, str, str]


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


_KNOWN: dict[_Key, Score] = {}


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
    jobs = [(family, seed) for family in families for seed in range(seeds)]
    new = [(job, [method for method in methods if _key(job, method) not in _KNOWN]) for job in jobs]
    new = [(job, missing) for job, missing in new if missing]
    for found in _mapped(new, min(processes, PROCESSES, len(new))):
        _KNOWN.update({_key((score.family, score.seed), score.method): score for score in found})
        tell(f"{found[0].family}, seed {found[0].seed}: {sum(score.cpu_s for score in found):.1f} s")
    return [_KNOWN[_key(job, method)] for job in jobs for method in methods]


_Job = tuple[tuple[str, int], list[Method]]


def _mapped(jobs: Sequence[_Job], processes: int) -> Iterator[list[Score]]:
    if processes <= 1:
        yield from map(_scored, jobs)
        return
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(_scored, jobs)


def _key(job: tuple[str, int], method: Method) -> _Key:
    return *job, *method.key


def _scored(job: _Job) -> list[Score]:
    (family, seed), methods = job
    scene = draw(FAMILIES[family], seed)
    part = cache(partial(_part, scene))
    return [_score(part(method.middle), method) for method in methods]


def _part(scene: Scene, middle: int | None) -> Scene:
    return scene if middle is None else scene.middle(middle)


def _score(scene: Scene, method: Method) -> Score:
    begun = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # peers warn of what they do to every scene
        found = np.asarray(method.find(scene))
    cpu_s = time.process_time() - begun
    return Score(scene.family.name, scene.seed, method, marks(found, scene.truth, scene.valid), cpu_s)
