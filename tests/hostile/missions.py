"""Cases of what a picture is drawn from: missions, paths, levels and states."""

from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case, chosen
from tests.hostile.mutate import bytes_mutated, json_mutated, tags_mutated, words_mutated

DRAWN = (
    ("x.tif", "--mission", "a.plan"),
    ("x.tif", "--mission", "a.waypoints"),
    ("x.tif", "--path", "a.plan"),
    ("x.tif", "--path", "a.waypoints"),
    ("x.tif", "--path", "p.geojson"),
    ("m.tif", "--states", "st.tif"),
)


def case(rng: Random) -> Case:
    """One of them changed, and drawn."""
    known = seeds.missions()
    raster, option, name = rng.choice(DRAWN)
    content = known[name]
    if name.endswith((".plan", ".geojson")) and chosen(rng, 0.7):
        content = json_mutated(content, rng)
    elif name.endswith(".tif"):
        content = rng.choice((bytes_mutated, tags_mutated))(content, rng)
    else:
        content = rng.choice((words_mutated, bytes_mutated))(content, rng)
    files = {name: content, raster: known[raster]}
    return Case(files, (("preview", raster, option, name, "-o", "out.png", "--width", "300"),))
