"""Error propagation: how far from its place the ground in a photograph is likely to be drawn."""

import math

import numpy as np

from uavseg.arrays import Floats
from uavseg.photographs.photograph import Photograph

POSITION_M = 3.0  # horizontal, of a satellite receiver without corrections
HEIGHT_M, HEIGHT_SHARE = 2.0, 0.02  # of a height above the ground, whichever is more
YAW_DEG, TILT_DEG = 1.5, 0.5  # of gimbals: about the vertical, and about each of two level axes


def likely_error_m(photograph: Photograph, pixels: Floats, below_m: Floats) -> Floats:
    """Return the standard deviation of where places of an image are put on the ground, in metres.

    The variances that the position, the height and three turns of the camera contribute add up, as those of
    independent errors do: about the vertical (yaw), and about the level axes to the right and ahead (pitch
    and roll). What each contributes is half the distance between the places that follow from one standard
    deviation less and more. The ground is level around each place, the lens without distortion. Where the
    file says the error of the position, that of the height is at most twice as much.

    Parameters
    ----------
    photograph : Photograph
    pixels : (n, 2) array
        Columns and rows from the upper left corner of the image.
    below_m : (n,) array
        How far the ground that is seen there lies below the camera, in metres.

    Returns
    -------
    errors : (n,) array
        Horizontal distances in metres; NaN where a ray does not reach the ground with every pose.

    References
    ----------
    .. [1] Wolf, P. R., Dewitt, B. A. and Wilkinson, B. E. (2014). Elements of Photogrammetry with
           Applications in GIS, 4th edition, McGraw-Hill, appendix A: propagation of random errors.
    """
    stated = photograph.position_error_m
    height_m = np.maximum(HEIGHT_M, HEIGHT_SHARE * below_m)
    if stated is not None:
        height_m = np.minimum(height_m, 2 * stated)

    rays = photograph.rays(pixels)
    yaw = math.radians(photograph.yaw_deg)
    up, right, ahead = (0, 0, 1), (math.cos(yaw), -math.sin(yaw), 0), (math.sin(yaw), math.cos(yaw), 0)

    def places(rays: Floats, below_m: Floats) -> Floats:
        down = np.where(rays[:, 2] < 0, -rays[:, 2], np.nan)
        found: Floats = rays[:, :2] * (below_m / down)[:, None]
        return found

    pairs = [(places(rays, below_m - height_m), places(rays, below_m + height_m))]
    for axis, error_deg in ((up, YAW_DEG), (right, TILT_DEG), (ahead, TILT_DEG)):
        turn = math.radians(error_deg) * np.cross(axis, rays)
        pairs.append((places(rays - turn, below_m), places(rays + turn, below_m)))
    variance = sum(((more - less) ** 2).sum(axis=1) / 4 for less, more in pairs)
    errors: Floats = np.sqrt((POSITION_M if stated is None else stated) ** 2 + variance)
    return errors
