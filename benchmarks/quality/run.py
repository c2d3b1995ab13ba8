"""Run all methods on all scenes, in two processes; results are cached for the lifetime of the process."""

import multiprocessing
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from benchmarks.quality.methods import Method
from benchmarks.quality.metrics import Metrics, measure
from benchmarks.quality.scenes import FAMILIES, Scene, draw

PROCESSES = 2  # at most
_SceneKey = tuple[str, int]  # family and seed
_Result = tuple[Metrics, float]  # and processor time


@dataclass(frozen=True, slots=True)
class Score:
    """Metrics of one method and setting on one scene.

    Parameters
    ----------
    family : str
    seed : int
    method : Method
    metrics : Metrics
    cpu_s : float
        Processor time in seconds.
    """

    family: str
    seed: int
    method: Method
    metrics: Metrics
    cpu_s: float


_CACHE: dict[tuple[_SceneKey, tuple[str, str]], _Result] = {}


def scores(
    methods: Sequence[Method],
    seeds: int = 3,
    families: Sequence[str] = tuple(FAMILIES),
    processes: int = PROCESSES,
    report: Callable[[str], None] = lambda line: None,
) -> list[Score]:
    """Scores of all methods on all scenes.

    Parameters
    ----------
    methods : sequence of Method
    seeds : int
        Number of scenes of each family.
    families : sequence of str
        Keys of `FAMILIES`.
    processes : int
        Number of processes; with 1 no other process is started.
    report : callable
        Receives a line for each finished scene.
    """
    keys = [(family, seed) for family in families for seed in range(seeds)]
    jobs = [(key, [method for method in methods if (key, method.key) not in _CACHE]) for key in keys]
    jobs = [(key, missing) for key, missing in jobs if missing]
    for (key, missing), found in zip(jobs, _run_all(jobs, min(processes, PROCESSES)), strict=True):
        _CACHE.update({(key, method.key): result for method, result in zip(missing, found, strict=True)})
        report(f"{key[0]}, seed {key[1]}: {sum(cpu_s for _, cpu_s in found):.1f} s")
    return [Score(*key, method, *_CACHE[key, method.key]) for key in keys for method in methods]


_Job = tuple[_SceneKey, list[Method]]


def _run_all(jobs: Sequence[_Job], processes: int) -> Iterator[list[_Result]]:
    if min(processes, len(jobs)) <= 1:
        yield from map(_run_scene, jobs)
        return
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(_run_scene, jobs)


def _run_scene(job: _Job) -> list[_Result]:
    (family, seed), methods = job
    scene = draw(FAMILIES[family], seed)
    cropped = cache(partial(_cropped, scene))
    return [_run_method(cropped(method.crop), method) for method in methods]


def _cropped(scene: Scene, crop: int | None) -> Scene:
    return scene if crop is None else scene.central_crop(crop)


def _run_method(scene: Scene, method: Method) -> _Result:
    begun = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # some peers warn on every scene
        found = np.asarray(method.segment(scene))
    cpu_s = time.process_time() - begun
    return measure(found, scene.truth, scene.valid), cpu_s
