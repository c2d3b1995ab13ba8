"""Cases of rasters: GeoTIFFs of many layouts changed by byte and by tag, and pictures."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Arguments, Case, chosen
from tests.hostile.mutate import bytes_mutated, tags_mutated

ONE = ("--threads", "1")
COMMANDS: tuple[Arguments, ...] = (
    ("info", "x.tif", *ONE),
    ("info", "x.tif", "--json", *ONE),
    ("extract", "x.tif", "--range", "0.4,1", "-o", "out.geojson", *ONE),
    ("extract", "x.tif", "--range", "0.4,1", "-o", "-", *ONE),
    ("extract", "x.tif", "--range", "0,1", "-o", "out.gpkg", "--refine", "none", *ONE),
    ("extract", "x.tif", "--range", "0.3,0.8", "-o", "out.kml", "--smooth-outline", "0.4", *ONE),
    ("extract", "x.tif", "--range", "0.3,0.8", "-o", "out.shp", "--method", "paper", *ONE),
    ("extract", "x.tif", "--range", "0.5,1", "-o", "out.parquet", "--labels", "out.vrt", *ONE),
    ("extract", "x.tif", "--range", "0.5,1", "-o", "out.fgb", "--labels", "out.tif", "--simplify", "2", *ONE),
    (
        "extract",
        "x.tif",
        "--range",
        "0.5,1",
        "-o",
        "out.geojson",
        "--mission",
        "out.plan",
        "--altitude",
        "50",
        "--home",
        "auto",
        *ONE,
    ),
    ("extract", "x.tif", "--values", "20,200", "-o", "out.geojson", *ONE),
    ("extract", "x.tif", "--percentile", "50,100", "-o", "out.gpkg", "--style", "qml", *ONE),
    ("extract", "x.tif", "--expr", "b1/2", "--range", "0.2,1", "-o", "out.geojson", *ONE),
    ("extract", "x.tif", "--class", "dark=0,0.4", "--class", "bright=0.4,1", "-o", "out.gpkg", *ONE),
    (
        "extract",
        "x.tif",
        "--range",
        "0,0.2",
        "--range",
        "0.6,1",
        "-o",
        "out.geojson",
        "--labels",
        "out.tif",
        *ONE,
    ),
    ("levels", "x.tif", "--breaks", "0.3,0.6", "-o", "out.geojson", *ONE),
    ("levels", "x.tif", "--width", "0.25", "-o", "out.geojson", "--min-area", "20", *ONE),
    ("match", "x.tif", "--like", "500020,4499980,16", "-o", "out.geojson", *ONE),
    ("match", "x.tif", "--like", "40,40,20", "-o", "out.geojson", *ONE),
    (
        "match",
        "x.tif",
        "--like",
        "500020,4499980,16",
        "--by",
        "texture",
        "-o",
        "out.gpkg",
        "--window",
        "16",
        *ONE,
    ),
    ("match", "x.tif", "--like", "40,40,20", "--unlike", "90,90,9", "--by", "color", "-o", "out.fgb", *ONE),
    ("match", "x.tif", "--classes", "cl.geojson", "-o", "out.geojson", "--labels", "out.tif", *ONE),
    ("extract", "x.tif", "--range", "0.4,1", "-o", "out.geojson", "--flatten", "40px", *ONE),
    (
        "extract",
        "x.tif",
        "--range",
        "0,0.3",
        "-o",
        "out.gpkg",
        "--thin-lines",
        "--min-confidence",
        "0.3",
        *ONE,
    ),
    (
        "extract",
        "x.tif",
        "--range",
        "0.4,1",
        "-o",
        "out.geojson",
        "--detail",
        "4px",
        "--progress",
        "plain",
        *ONE,
    ),
    ("extract", "x.tif", "--each", "--range", "0.4,1", "-o", "out.{stem}.gpkg", "--report", "out.csv", *ONE),
    ("suggest", "x.tif", "--like", "40,40,20", "--json", *ONE),
    ("suggest", "x.tif", "--classes", "2", *ONE),
    ("map", "x.tif", "-o", "out.html", "--size", "64", *ONE),
    ("suggest", "x.tif", "-o", "out.png", *ONE),
    ("suggest", "x.tif", "--json", *ONE),
    ("classify", "x.tif", "-o", "out.tif", "--objects", "out.geojson", "--stretch", "dtype", *ONE),
    ("classify", "x.tif", "-o", "out.yaml", "--stretch", "none", *ONE),
    ("divide", "x.tif", "-o", "out.tif", *ONE),
    ("original", "x.tif", "-o", "out.tif", "--sweeps", "1", *ONE),
    (
        "path",
        "x.tif",
        "--range",
        "0,0.9",
        "--start",
        "500005,4499920",
        "--goal",
        "500030,4499930",
        "-o",
        "out.geojson",
        "--stretch",
        "dtype",
        "--smooth",
        *ONE,
    ),
    ("preview", "x.tif", "-o", "out.png", "--width", "300"),
    ("serve", "x.tif", "--size", "64", *ONE),
    ("plan", "r.geojson", "-o", "out.plan", "--altitude", "50", "--home", "auto", "--dem", "x.tif"),
    ("extract", "x.tif", "y.tif", "--range", "0.4,1", "-o", "out.geojson", *ONE),
    ("extract", "x.tif", "y.tif", "--warp", "--range", "0.4,1", "-o", "out.geojson", *ONE),
    ("extract", "y.tif", "x.tif", "--warp", "--range", "0.4,1", "-o", "out.geojson", *ONE),
    ("info", "y.tif", "x.tif", "--warp", "--json"),
)
STRETCHED = ("extract", "levels", "divide", "suggest", "info")
SAME: tuple[Arguments, ...] = (
    ("extract", "x.tif", "--range", "0.4,1", "-o", "o{n}.geojson", *ONE),
    ("levels", "x.tif", "--width", "0.25", "-o", "o{n}.geojson", *ONE),
    ("divide", "x.tif", "-o", "o{n}.tif", *ONE),
    ("classify", "x.tif", "-o", "o{n}.tif", "--stretch", "dtype", *ONE),
    ("suggest", "x.tif", "--json", *ONE),
    ("extract", "x.tif", "--percentile", "50,100", "-o", "o{n}.geojson", *ONE),
    ("extract", "x.tif", "--range", "0,0.2", "--range", "0.6,1", "-o", "o{n}.geojson", *ONE),
    ("extract", "x.tif", "--range", "0.4,1", "--flatten", "40px", "-o", "o{n}.geojson", *ONE),
    ("extract", "x.tif", "--range", "0,0.3", "--thin-lines", "--detail", "4px", "-o", "o{n}.geojson", *ONE),
    ("extract", "x.tif", "--range", "0.4,1", "--min-confidence", "0.4", "-o", "o{n}.geojson", *ONE),
    ("match", "x.tif", "--like", "40,40,20", "-o", "o{n}.geojson", *ONE),
    ("match", "x.tif", "--like", "40,40,20", "--by", "texture", "--window", "16", "-o", "o{n}.geojson", *ONE),
    ("match", "x.tif", "--classes", "cl.geojson", "-o", "o{n}.geojson", *ONE),
)


def case(rng: Random) -> Case:
    """A raster changed, and a command; at times the same command twice, with other tiles."""
    known = seeds.rasters()
    name = rng.choice(list(known))
    mutator = rng.choice((bytes_mutated, tags_mutated, tags_mutated))
    content = mutator(known[name], rng)
    if chosen(rng, 0.15):
        content = bytes_mutated(content, rng)
    files = {"x.tif": content}
    if chosen(rng, 0.25):
        command = rng.choice(SAME)
        skip = ("--skip-bad-tiles",) if command[0] not in ("classify",) and chosen(rng, 0.5) else ()
        tiles = (("--tile", "64"), ("--tile", "128"))
        commands = tuple(
            tuple(word.replace("{n}", str(n)) for word in (*command, *skip, *tile))
            for n, tile in enumerate(tiles)
        )
        return Case(files | _samples(command), commands, ("o0", "o1"), same=True)
    command = rng.choice(COMMANDS)
    if "y.tif" in command:
        files["y.tif"] = known["near.tif" if "--warp" in command else "deflate.tif"]
    if "r.geojson" in command:
        files["r.geojson"] = seeds.vectors()["r.geojson"]
    if command[0] in STRETCHED and chosen(rng, 0.3):
        command = (*command, "--stretch", rng.choice(("dtype", "minmax", "none", "percentile:1,99", "0,100")))
    return Case(files | _samples(command), (command,))


def _samples(command: Arguments) -> dict[str, bytes]:
    return {"cl.geojson": seeds.vectors()["cl.geojson"]} if "cl.geojson" in command else {}
