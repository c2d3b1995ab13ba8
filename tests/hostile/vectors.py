"""Cases of regions: vector files of every format by byte, GeoJSON by value, KML and CSV by word."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Arguments, Case, chosen
from tests.hostile.mutate import bytes_mutated, json_mutated, words_mutated
from tests.hostile.options import CLASSES

FLIGHT = ("--altitude", "50", "--home", "auto")
COMMANDS: tuple[Arguments, ...] = (
    ("plan", "{r}", "-o", "out.plan", *FLIGHT),
    ("plan", "{r}", "-o", "out.waypoints", *FLIGHT, "--pattern", "perimeter"),
    ("plan", "{r}", "-o", "out.plan", "--altitude", "50", "--home", "40.645,15.0,10", "--spacing", "20"),
    ("plan", "{r}", "-o", "out.plan", *FLIGHT, "--where", "mean > 0.2 and area_m2 > 1"),
    ("plan", "{r}", "-o", "out.plan", *FLIGHT, "--largest", "2", "--angle", "30", "--spacing", "5"),
    ("preview", "x.tif", "--regions", "{r}", "-o", "out.png", "--width", "300"),
    ("preview", "x.tif", "--levels", "{r}", "-o", "out.png", "--width", "300"),
    ("info", "{r}"),
    ("info", "{r}", "--json"),
    ("plan", "own.geojson", "-o", "out.plan", *FLIGHT, "--avoid", "{r}", "--avoid-margin", "3"),
    ("check", "a.plan", "--avoid", "{r}"),
    ("map", "x.tif", "--regions", "{r}", "-o", "out.html", "--size", "64", "--threads", "1"),
    ("suggest", "x.tif", "--like", "{r}", "--json", "--threads", "1"),
    ("match", "x.tif", "--like", "500048,4499952,20", "--unlike", "{r}", "-o", "out.fgb", "--threads", "1"),
    ("match", "x.tif", "--like", "{r}", "-o", "out.geojson", "--threads", "1"),
    ("match", "x.tif", "--classes", "{r}", "-o", "out.geojson", "--threads", "1"),
)
STDIN = ("plan", "-", "-o", "out.plan", *FLIGHT)
PARTS = {"r.shp": ("r.shp", "r.shx", "r.dbf", "r.prj", "r.cpg")}
NAMES = (
    "r.geojson",
    "hand.geojson",
    "r.gpkg",
    "r.fgb",
    "r.parquet",
    "r.shp",
    "r.kml",
    "hand.kml",
    "r.csv",
    "lv.geojson",
    "cl.geojson",
)


def case(rng: Random) -> Case:
    """A file of regions changed, and a command that reads it; at times a file of classes."""
    known = seeds.vectors()
    if chosen(rng, 0.05):
        return _classes(known["x.tif"], rng)
    name = rng.choice(NAMES)
    parts = PARTS.get(name, (name,))
    files = {part: known[part] for part in parts}
    broken = rng.choice(parts)
    files[broken] = _changed(broken, known[broken], rng)
    if len(parts) > 1 and chosen(rng, 0.1):
        del files[rng.choice(parts[1:])]
    if name.endswith(".geojson") and chosen(rng, 0.25):
        return Case({}, (STDIN,), stdin=files[name])
    command = tuple(word.replace("{r}", name) for word in rng.choice(COMMANDS))
    others = {
        "x.tif": known["x.tif"],
        "own.geojson": known["r.geojson"],
        "a.plan": seeds.missions()["a.plan"],
    }
    return Case(files | {word: others[word] for word in command if word in others}, (command,))


def _classes(raster: bytes, rng: Random) -> Case:
    name = rng.choice(list(CLASSES))
    content = rng.choice((words_mutated, words_mutated, bytes_mutated))(CLASSES[name], rng)
    command = ("extract", "x.tif", "--classes", name, "-o", "out.gpkg", "--threads", "1")
    return Case({name: content, "x.tif": raster}, (command,))


def _changed(name: str, content: bytes, rng: Random) -> bytes:
    if name.endswith(".geojson") and chosen(rng, 0.7):
        return json_mutated(content, rng)
    if name.endswith((".kml", ".csv", ".prj", ".geojson", ".cpg")) and chosen(rng, 0.6):
        return words_mutated(content, rng)
    return bytes_mutated(content, rng)
