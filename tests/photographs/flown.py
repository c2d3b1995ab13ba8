"""Photographs of a mission as files: `python -m tests.photographs.flown MISSION FOLDER [--without N,N]`.

They are small, and all grey, with the tags of DJI; QGIS's own Python, which tests run in, cannot make them.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from tests.photographs.make import draw_photograph
from uavseg.flight.formats.files import read_mission
from uavseg.photographs.coverage import planned_photographs

SIZE, FOCAL_PX = (80, 60), 60.0


def fly(mission: Path, folder: Path, without: tuple[int, ...] = ()) -> list[Path]:
    """Write the photographs that a mission plans, but for some, counted from 1."""
    folder.mkdir(exist_ok=True)
    planned = planned_photographs(read_mission(mission), (SIZE, FOCAL_PX)).photographs
    return [
        draw_photograph(folder / f"{number:04d}.jpg", replace(one, taken_s=1.7e9 + 2 * number))
        for number, one in enumerate(planned, 1)
        if number not in without
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("mission", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--without", default="")
    given = parser.parse_args()
    fly(given.mission, given.folder, tuple(map(int, filter(None, given.without.split(",")))))
