"""Cases of files of cameras and vehicles: by value of the JSON, by word and by byte."""

import json
from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case
from tests.hostile.mutate import bytes_mutated, json_mutated, words_mutated

CAMERA = json.dumps(
    {
        "name": "drawn",
        "sensor_width_mm": 13.2,
        "sensor_height_mm": 8.8,
        "image_width_px": 5472,
        "image_height_px": 3648,
        "focal_mm": 8.8,
        "min_interval_s": 2,
    }
).encode()
VEHICLE = json.dumps(
    {
        "name": "drawn",
        "turns": "blend",
        "climb_m_s": 3,
        "descent_m_s": 2,
        "hover_w": 300,
        "cruise_w": 260,
        "battery_wh": 90,
    }
).encode()
PLAN = ("plan", "r.geojson", "-o", "out.plan", "--altitude", "50", "--home", "auto")
COMMANDS = (
    (*PLAN, "--camera", "c.json", "--overlap", "75,60"),
    (*PLAN, "--camera", "c.json", "--trigger", "interval", "--json", "--footprints"),
    (*PLAN, "--vehicle", "v.json", "--spacing", "20", "--json"),
    (*PLAN, "--vehicle", "v.json", "--camera", "c.json", "--autopilot", "px4"),
    ("map", "x.tif", "-o", "out.html", "--size", "64", "--mission", "a.plan", "--camera", "c.json"),
)


def case(rng: Random) -> Case:
    """A plan with a camera or a vehicle that is changed."""
    command = rng.choice(COMMANDS)
    files = {"c.json": CAMERA, "v.json": VEHICLE}
    name = rng.choice([name for name in files if name in command])
    change = rng.choice((json_mutated, json_mutated, words_mutated, bytes_mutated))
    files[name] = change(files[name], rng)
    known = seeds.vectors()
    others = {"r.geojson": known["r.geojson"], "x.tif": known["x.tif"], "a.plan": seeds.missions()["a.plan"]}
    return Case(files | others, (command,))
