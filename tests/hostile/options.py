"""Cases of options: some added to a command line, one or two words replaced, and odd names of files."""

from pathlib import Path
from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case, chosen
from tests.hostile.command_lines import LINES, added_to
from tests.hostile.mutate import WORDS

ZONE = b"""{"type": "Polygon", "coordinates": [[[15.001, 40.651], [15.0015, 40.651], [15.001, 40.6515],
                                                 [15.001, 40.651]]]}"""
CLASSES = {
    "c.csv": b'name,range,color\ndark,"0,0.4",#102030\nbright,"0.4,1",\n',
    "c.yaml": b"- {name: dark, low: 0, high: 0.4}\n- {name: bright, range: '0.4,1', color: '#ffee00'}\n",
}
NAMES = (
    "out\n.geojson", "out\x1b[31m.geojson", "out\udce9.geojson", "\udcff", "a" * 300 + ".tif", "a/" * 3000, "",
    "\x01", "\n", ".", "..", "/", "/dev/null", "/dev/full", "/proc/self/mem", "no/such/out.geojson", "x.tif",
    "out", "out.xyz", "-", "--", "out.geojson\n", "out.tif ", "out.TIF", "out.vrt", "out.plan", "out\u202e.kml",
    "out\udce9.tif", "out\udce9.plan", "out\udce9.gpkg", "out\n.gpkg", "out\n.tif", "out\n.png", "out\n.shp",
    "x\n.tif", "r\n.geojson", "a" * 5000, "out?.gpkg", "out%41.gpkg", "out'.gpkg", 'out".vrt', "out&.kml", "out\\.tif",
)  # fmt: skip


def case(rng: Random) -> Case:
    """A command line with options added, or one or two other words, or both."""
    files = _files()
    line = list(rng.choice(LINES))
    added = rng.choice((0, 0, 1, 2))
    for _ in range(added):
        line += rng.choice(added_to(line[0]) or ((),))
    for _ in range(rng.choice((0, 1, 2) if added else (1, 1, 2))):
        at = rng.randrange(1, len(line))
        named = "." in line[at] and not line[at][0].isdigit()
        word = rng.choice(NAMES if named or chosen(rng, 0.15) else WORDS).replace("\0", "")
        line[at] = word
    command = tuple(
        word.encode("utf-8", "surrogateescape").decode("utf-8", "surrogateescape") for word in line
    )
    used = {name: content for name, content in files.items() if any(name in word for word in command)}
    if chosen(rng, 0.05):
        used["x\n.tif"] = files["x.tif"]
    beside = {f"{Path(word).stem}." for word in line if Path(word).suffix}  # a style, parts of a Shapefile
    return Case(used, (command,), ("out", "done", *(word for word in line if word), *sorted(beside)))


def _files() -> dict[str, bytes]:
    drawn = seeds.missions()
    names = {"rgb.tif": "jpeg.tif", "g.tif": "lerc.tif", "w.tif": "near.tif"}
    pictures = {name: seeds.rasters()[seed] for name, seed in names.items()}
    others = pictures | {"b.tif": seeds.block_map()["b.tif"], "m.pgm": seeds.ros_maps()["m.pgm"]}
    names = ("r.geojson", "lv.geojson", "cl.geojson", "r.gpkg", "r.kml", "r.parquet", "r.fgb")
    regions = {name: seeds.vectors()[name] for name in names}
    vehicle = {"v.json": b'{"hover_w": 200, "cruise_w": 180, "battery_wh": 80}'}
    others |= seeds.bags() | {name: seeds.photographs()[name] for name in ("p.jpg", "p.tif", "0.jpg")}
    return drawn | others | regions | vehicle | CLASSES | {"z.geojson": ZONE}
