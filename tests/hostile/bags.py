"""Cases of bags: by byte, cut, and as another kind than they are."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case, chosen
from tests.hostile.mutate import bytes_mutated, words_mutated

WORDS = (
    ("--odom", "/odom"),
    ("--tf",),
    ("--tf", "--max-range", "1"),
    ("--resolution", "0.2"),
    ("--scan", "/echo"),
    ("--scan", "/points", "--heights", "0.1,1.8"),
    ("--no-return", "range_max", "--beam-order", "angles"),
)


def case(rng: Random) -> Case:
    """A bag changed, and merged."""
    words = rng.choice(WORDS)
    output = rng.choice(("out.yaml", "out.tif"))
    if chosen(rng, 0.2):
        return Case(_folder(rng), (("build-map", "db3", "-o", output, *words),))
    name = rng.choice(("a.bag", "a.db3", "a.mcap"))
    content = _changed(seeds.bags()[name], rng)
    if chosen(rng, 0.1):
        name = rng.choice(("a.bag", "a.db3", "a.mcap"))
    return Case({name: content}, (("build-map", name, "-o", output, *words),))


def _folder(rng: Random) -> dict[str, bytes]:
    """A folder of ROS 2, of which the description or the recording is changed."""
    known = seeds.bags()
    files = {"db3/metadata.yaml": known["db3/metadata.yaml"], "db3/db3.db3": known["a.db3"]}
    if chosen(rng, 0.2):
        files["db3/db3.db3"] = _changed(files["db3/db3.db3"], rng)
    else:
        change = rng.choice((words_mutated, words_mutated, bytes_mutated))
        files["db3/metadata.yaml"] = change(files["db3/metadata.yaml"], rng)
    return files


def _changed(content: bytes, rng: Random) -> bytes:
    return bytes_mutated(content, rng) if chosen(rng, 0.8) else content[: rng.randrange(len(content))]
