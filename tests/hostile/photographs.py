"""Cases of photographs: tags by word and by byte, and files cut short."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case, chosen
from tests.hostile.mutate import bytes_mutated, words_mutated


def case(rng: Random) -> Case:
    """One or two photographs changed, and drawn on flat ground or an elevation model."""
    known = seeds.photographs()
    files = {name: known[name] for name in rng.sample(sorted(known), rng.choice((1, 2, 3)))}
    for name in rng.sample(sorted(files), min(len(files), rng.choice((1, 2)))):
        header, rest = files[name][:3000], files[name][3000:]
        if name.endswith(".tif"):  # whose tags follow the pixels
            header, rest = files[name], b""
        files[name] = rng.choice((bytes_mutated, bytes_mutated, words_mutated))(header, rng) + rest
    others = {"g.tif": seeds.rasters()["lerc.tif"]}
    ground = rng.choice(
        (
            (),
            ("--dem", "g.tif"),
            ("--home", "40.6500,15.0005"),
            ("--home", "40.6500,15.0005,90", "--dem", "g.tif"),
            ("--camera", "Sequoia"),
        )
    )
    output = rng.choice(("out.gpkg", "out.geojson", "out.kml", "-"))
    sources = (".",) if chosen(rng, 0.2) else tuple(sorted(files))
    if chosen(rng, 0.4):
        return Case(files | others, (("georeference", *sources, "-o", "out.tif", *ground),))
    return Case(files | others, (("footprints", *sources, "-o", output, *ground),))
