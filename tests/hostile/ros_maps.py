"""Cases of ROS maps: the YAML file by word and by byte, the picture by byte."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Arguments, Case, chosen
from tests.hostile.mutate import bytes_mutated, words_mutated

ONE = ("--threads", "1")
COMMANDS: tuple[Arguments, ...] = (
    ("classify", "m.yaml", "-o", "out.yaml", *ONE),
    ("classify", "m.yaml", "-o", "out.tif", "--objects", "out.geojson", *ONE),
    (
        "path",
        "m.yaml",
        "--range",
        "0,0.6",
        "--start",
        "-0.5,3",
        "--goal",
        "0.5,3.5",
        "-o",
        "out.geojson",
        "--smooth",
        *ONE,
    ),
    ("levels", "m.yaml", "--width", "0.3", "-o", "out.geojson", *ONE),
    ("preview", "m.yaml", "-o", "out.png", "--width", "300"),
    ("info", "m.yaml", *ONE),
    ("suggest", "m.yaml", "--classes", "3", *ONE),
    ("extract", "m.yaml", "--range", "0.6,1", "-o", "out.geojson", *ONE),
    ("classify", "m.pgm", "--free-is-white", "-o", "out.tif", *ONE),
)
ODD = (
    b"\nimage: [m.pgm]\n", b"\norigin: {a: 1}\n", b"\nmode: scale\n", b"\nmode: raw\n", b"\nnegate: true\n",
    b"\nresolution: !!python/object:os.system x\n", b"\n? [a, b]\n: c\n", b"\norigin: [.inf, .nan, 0]\n",
    b"\nresolution: 2001-01-01\n", b"\nnegate: 1" + b"0" * 5000 + b"\n", b"\n&a x: *a\n", b"\t\n", b"\0", b"\n---\n",
    b'\nimage: "m\\u0000.pgm"\n', b'\nimage: "a\\nb"\n', b'\nimage: "\\e[31m"\n', b"\nimage: " + b"a" * 4000 + b"\n",
    b"\nresolution: 1e-300\n", b"\nresolution: 1e300\n", b"\norigin: [1e308, 1e308, 1e308]\n", b"\nmode: [raw]\n",
    b"\nimage: .\n", b"\nimage: m.yaml\n", b"\nimage: ../outside/none.pgm\n", b"\n1: 2\n", b"\n? {}\n",
)  # fmt: skip


def case(rng: Random) -> Case:
    """A map of which the description or the picture is changed."""
    known = seeds.ros_maps()
    picture = rng.choice(("m.pgm", "p.pgm", "m.png"))
    described, content = known["m.yaml"].replace(b"m.pgm", picture.encode()), known[picture]
    if picture == "m.png":
        described = described.replace(b"trinary", rng.choice((b"scale", b"trinary", b"raw")))
    kind = rng.randrange(4)
    if kind == 0:
        described = words_mutated(described, rng)
    elif kind == 1:
        described += rng.choice(ODD)
    elif kind == 2:
        described = bytes_mutated(described, rng, 3)
    if kind == 3 or chosen(rng, 0.1):
        header = content[:30]
        content = (
            words_mutated(header, rng) + content[30:]
            if picture != "m.png" and chosen(rng, 0.5)
            else bytes_mutated(content, rng)
        )
    return Case({"m.yaml": described, picture: content}, (rng.choice(COMMANDS),))
