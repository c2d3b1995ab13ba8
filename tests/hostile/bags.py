"""Cases of bags: by byte, cut, and as another kind than they are."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case, chosen
from tests.hostile.mutate import bytes_mutated

WORDS = (("--odom", "/odom"), ("--tf",), ("--tf", "--max-range", "1"), ("--resolution", "0.2"))


def case(rng: Random) -> Case:
    """A bag changed, and merged."""
    name = rng.choice(("a.bag", "a.db3", "a.mcap"))
    content = seeds.bags()[name]
    content = bytes_mutated(content, rng) if chosen(rng, 0.8) else content[: rng.randrange(len(content))]
    if chosen(rng, 0.1):
        name = rng.choice(("a.bag", "a.db3", "a.mcap"))
    output = rng.choice(("out.yaml", "out.tif"))
    return Case({name: content}, (("build-map", name, "-o", output, *rng.choice(WORDS)),))
