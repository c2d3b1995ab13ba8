"""Moving pictures of a drive: the map as the robot knows it, its track and where it stands."""

from typing import Any

import numpy as np

from uavseg.arrays import Floats, Path_, Uint8s
from uavseg.occupancy.explore.drive import Drive
from uavseg.occupancy.map_file import trinary_states
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.output.atomic import atomic_file
from uavseg.units import FREE, OCCUPIED, UNKNOWN

_TRACK, _ROBOT = 4, 5  # in the palette, after the states
_PALETTE = {0: (150, 150, 150), FREE: (255, 255, 255), UNKNOWN: (150, 150, 150), OCCUPIED: (20, 20, 20)}
_PALETTE |= {_TRACK: (34, 139, 230), _ROBOT: (240, 62, 62)}
_SIDE_PX = 640
_MAX_FRAMES = 150
_FRAME_MS, _LAST_MS = 80, 3000


def write_animation(drive: Drive, path: Path_, overwrite: bool = False) -> None:
    """Write a GIF of a drive, whose scans are taken again, as they were, to draw the map after each."""
    grid = OccupancyGrid(drive.grid.geobox)
    every = -(-len(drive.poses) // _MAX_FRAMES)
    place = np.stack((~grid.geobox.transform) * drive.xy.T, axis=1)  # (n, 2) columns and rows
    frames = []
    for number in range(len(drive.poses)):
        grid.merge(drive.scan(number))
        if number % every == 0 or number == len(drive.poses) - 1:
            frames.append(_frame(trinary_states(grid.probabilities), place[: number + 1]))
    durations = [_FRAME_MS] * (len(frames) - 1) + [_LAST_MS]
    with atomic_file(path, overwrite) as temporary:
        frames[0].save(temporary, "GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0)


def _frame(states: Uint8s, track: Floats) -> Any:
    """Draw the map and the track so far, as a picture of Pillow with a palette."""
    from PIL import Image, ImageDraw

    scale = _SIDE_PX / max(states.shape)
    size = max(round(states.shape[1] * scale), 1), max(round(states.shape[0] * scale), 1)
    picture = Image.fromarray(states).resize(size, Image.Resampling.NEAREST)
    picture.putpalette([level for color in _PALETTE.values() for level in color])
    draw = ImageDraw.Draw(picture)
    points = [tuple(point) for point in (track * scale).tolist()]
    if len(points) > 1:
        draw.line(points, fill=_TRACK, width=2)
    x, y = points[-1]
    draw.ellipse((x - 5, y - 5, x + 5, y + 5), fill=_ROBOT)
    return picture
