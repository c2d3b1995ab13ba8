"""Cases of scenes: by value of the JSON, by word and by byte."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case
from tests.hostile.mutate import bytes_mutated, json_mutated, words_mutated

COMMANDS = (
    ("simulate", "s.json", "-o", "out.tif"),
    ("simulate", "s.json", "-o", "out.tif", "--truth", "out2.tif", "--png", "out.png"),
    ("simulate", "s.json", "-o", "out.tif", "--sigma", "0.03", "--step", "5"),
)


def case(rng: Random) -> Case:
    """A scene changed, and simulated."""
    change = rng.choice((json_mutated, json_mutated, words_mutated, bytes_mutated))
    return Case({"s.json": change(seeds.SCENE, rng)}, (rng.choice(COMMANDS),))
