"""Cases of kept results: a folder of `--resume` of which a file is changed by byte."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case
from tests.hostile.mutate import bytes_mutated


def case(rng: Random) -> Case:
    """A run that goes on from a folder in which something is damaged."""
    kept = dict(seeds.kept_results())
    name = rng.choice(list(kept))
    kept[name] = bytes_mutated(kept[name], rng)
    return Case({"x.tif": seeds.rasters()["deflate.tif"], **kept}, (seeds.RESUMED,), ("out", "done"))
