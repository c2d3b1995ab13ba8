"""Cases of what a picture is drawn from: missions, paths, levels and states."""

import zipfile
from io import BytesIO
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
CHECKED = ("a.plan", "e.plan", "a.waypoints", "a.kml", "a.geojson", "a.kmz", "a.csv")


def case(rng: Random) -> Case:
    """One of them changed, and drawn or checked."""
    known = seeds.missions()
    if chosen(rng, 0.5):
        return _checked(known, rng)
    raster, option, name = rng.choice(DRAWN)
    content = known[name]
    if name.endswith((".plan", ".geojson")) and chosen(rng, 0.7):
        content = json_mutated(content, rng)
    elif name.endswith(".tif"):
        content = rng.choice((bytes_mutated, tags_mutated))(content, rng)
    else:
        content = rng.choice((words_mutated, bytes_mutated))(content, rng)
    files = {name: content, raster: known[raster]}
    if option == "--mission" and chosen(rng, 0.3):
        return Case(
            files, (("map", raster, option, name, "-o", "out.html", "--size", "64", "--threads", "1"),)
        )
    return Case(files, (("preview", raster, option, name, "-o", "out.png", "--width", "300"),))


def _checked(known: dict[str, bytes], rng: Random) -> Case:
    """A mission file changed, and checked or drawn without a raster."""
    name = rng.choice(CHECKED)
    content = known[name]
    if name.endswith((".plan", ".geojson")) and chosen(rng, 0.7):
        content = json_mutated(content, rng)
    elif name.endswith(".kmz") and chosen(rng, 0.7):
        content = _kmz_mutated(content, rng)
    else:
        content = rng.choice((words_mutated, bytes_mutated))(content, rng)
    requested = rng.choice(((), ("--autopilot", "px4"), ("--autopilot", "generic"), ("--json",)))
    command = rng.choice(
        (
            ("preview", name, "-o", "out.png", "--width", "300"),
            ("upload", name, "--connect", "tcp:127.0.0.1:9", "--timeout", "1"),
            *[("check", name, *requested)] * 4,
        )
    )
    return Case({name: content}, (command,))


def _kmz_mutated(content: bytes, rng: Random) -> bytes:
    """An archive of which one document is changed."""
    stream = BytesIO()
    with zipfile.ZipFile(BytesIO(content)) as old, zipfile.ZipFile(stream, "w") as new:
        for member in old.namelist():
            new.writestr(member, rng.choice((words_mutated, bytes_mutated))(old.read(member), rng))
    return stream.getvalue()
