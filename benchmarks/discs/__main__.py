"""Like one disc, in families of drawn scenes: `match` beside other methods that learn from samples.

    python -m benchmarks.discs [SCENES]

SCENES is the number of scenes of each family, 6 by default. Methods with a star also get three discs of the
same radius on other ground.
"""

import sys
import time
import warnings
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks import table
from benchmarks.discs.methods import METHODS, skipped
from benchmarks.discs.scenes import FAMILIES, SEEDS, SIDE, scene
from benchmarks.match import overlap

FAILED = 0.5  # intersection over union


def report(seeds: int, side: int = SIDE, families: Sequence[str] = tuple(FAMILIES)) -> str:
    """The table of means, how many scenes each method fails on, and the time of each.

    Parameters
    ----------
    seeds : int
        Scenes of each family.
    side : int
    families : sequence of str
    """
    absent = skipped()
    methods = [name for name in METHODS if name not in absent]
    requested = [(family, seed) for family in families for seed in range(seeds)]
    with ProcessPoolExecutor() as pool:
        measured = list(pool.map(partial(measure, methods, side), *zip(*requested, strict=True)))
    found: dict[str, list[list[float]]] = {}
    for (family, _), (values, _) in zip(requested, measured, strict=True):
        for row in (family, "all"):
            found.setdefault(row, []).append(values)
    failed = [sum(value < FAILED for value in column) for column in zip(*found["all"], strict=True)]
    spent = [
        sum(column) / len(requested) for column in zip(*(seconds for _, seconds in measured), strict=True)
    ]
    last = [
        ["below 0.5", str(len(requested)), *map(str, failed)],
        ["CPU s", "", *(f"{mean:.1f}" for mean in spent)],
    ]
    lines = [
        f"{side}² pixels, {seeds} scenes of each family; intersection over union.",
        "",
        table.mean_rows(found, ["", "scenes", *methods]),
        *(f"| {' | '.join(cells)} |" for cells in last),
    ]
    reasons = [f"- {name}: {reason}" for name, reason in absent.items()]
    return "\n".join([*lines, *([""] if reasons else []), *reasons])


def measure(methods: Sequence[str], side: int, family: str, seed: int) -> tuple[list[float], list[float]]:
    """Intersection over union, and seconds of the processor, of each method on one scene."""
    values, seconds = [], []
    with TemporaryDirectory() as folder, warnings.catch_warnings(action="ignore"):
        requested = scene(family, seed, Path(folder), side)
        for name in methods:
            begun = time.process_time()
            values.append(overlap(METHODS[name](requested), requested.truth))
            seconds.append(time.process_time() - begun)
    print(f"{family} {seed}:", *(f"{value:.3f}" for value in values), file=sys.stderr, flush=True)
    return values, seconds


if __name__ == "__main__":
    print(report(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS))
