"""Cases of rasters in formats beside TIFF, and of files beside a raster: by byte, and texts by word."""

from pathlib import PurePosixPath
from random import Random

from tests.hostile.case import Arguments, Case, chosen
from tests.hostile.format_seeds import formats
from tests.hostile.mutate import bytes_mutated, words_mutated

ONE = ("--threads", "1")
COMMANDS: tuple[Arguments, ...] = (
    ("info", "{x}", *ONE),
    ("info", "{x}", "--json", *ONE),
    ("extract", "{x}", "--range", "0.4,1", "-o", "out.geojson", *ONE),
    ("extract", "{x}", "--range", "0,1", "-o", "out.gpkg", "--skip-bad-tiles", *ONE),
    ("extract", "{x}", "--values", "20,200", "-o", "out.geojson", *ONE),
    ("match", "{x}", "--like", "40,40,20", "-o", "out.geojson", *ONE),
    ("classify", "{x}", "-o", "out.tif", "--stretch", "dtype", *ONE),
    ("divide", "{x}", "-o", "out.tif", *ONE),
    ("suggest", "{x}", *ONE),
    ("preview", "{x}", "-o", "out.png", "--width", "300"),
    ("map", "{x}", "-o", "out.html", "--size", "64", *ONE),
    ("serve", "{x}", "--size", "64", *ONE),
)
SAME: tuple[Arguments, ...] = (
    ("extract", "{x}", "--range", "0.4,1", "-o", "o{n}.geojson", *ONE),
    ("divide", "{x}", "-o", "o{n}.tif", *ONE),
    ("extract", "{x}", "--percentile", "50,100", "-o", "o{n}.geojson", *ONE),
)
NOT_REPEATABLE = {"hfa"}  # GDAL fills damaged blocks with what the memory held, see docs/security.md
TEXTS = (".txt", ".asc", ".bpw", ".gfw", ".hdr", ".jgw", ".pgw", ".prj", ".tfw", ".vrt", ".wld", ".xml")


def case(rng: Random) -> Case:
    """A raster or what lies beside it changed, and a command; at times the same with other tiles."""
    known = formats()
    folder = rng.choice(sorted({PurePosixPath(name).parts[0] for name in known}))
    files = {PurePosixPath(name).name: known[name] for name in known if name.startswith(f"{folder}/")}
    broken = rng.choice(list(files))
    is_text = broken.endswith(TEXTS) and chosen(rng, 0.7)
    files[broken] = (words_mutated if is_text else bytes_mutated)(files[broken], rng)
    [x] = [
        "@x.txt" if name == "x.txt" else name
        for name in files
        if name.count(".") == 1 and name.startswith("x.") and _is_raster(name)
    ]
    if chosen(rng, 0.05) and len(files) > 1:
        del files[rng.choice([name for name in files if name != x])]
    if chosen(rng, 0.25) and folder not in NOT_REPEATABLE:
        skip = ("--skip-bad-tiles",) if chosen(rng, 0.5) else ()
        line = rng.choice(SAME)
        return Case(
            files,
            tuple(_named((*line, *skip, "--tile", tile), x, n) for n, tile in enumerate(("64", "128"))),
            ("o0", "o1"),
            same=True,
        )
    return Case(files, (_named(rng.choice(COMMANDS), x),))


def _is_raster(name: str) -> bool:
    return name.endswith((".asc", ".txt", ".vrt")) or not name.endswith(TEXTS)


def _named(line: Arguments, raster: str, number: int = 0) -> Arguments:
    return tuple(word.replace("{x}", raster).replace("{n}", str(number)) for word in line)
