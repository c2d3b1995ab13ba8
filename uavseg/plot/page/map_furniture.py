"""Map furniture: scale bar and north arrow, with readable lengths and areas."""

import math
from typing import Any

import numpy as np

from uavseg.plot.page.frame import Frame

TEXT_COLOR, PAPER_COLOR = "#1a1a1a", "#ffffff"


def bar_length(span: float) -> float:
    """A round length (1, 2 or 5 times a power of ten), the longest that is at most a quarter of `span`.

    Examples
    --------
    >>> bar_length(320.0), bar_length(79.9), bar_length(0.05)
    (50.0, 10.0, 0.01)
    """
    room = span / 4
    power = 10.0 ** math.floor(math.log10(room))
    return max(round(digit * power, 12) for digit in (0.5, 1, 2, 5) if digit * power <= room * (1 + 1e-12))


def length_text(length: float, unit: str) -> str:
    """A length with a readable unit.

    Examples
    --------
    >>> length_text(2000.0, "m"), length_text(50.0, "m"), length_text(0.2, "m"), length_text(500.0, "px")
    ('2 km', '50 m', '20 cm', '500 px')
    """
    if unit == "m" and length >= 1000:
        return f"{length / 1000:g} km"
    if unit == "m" and length < 1:
        return f"{length * 100:g} cm"
    return f"{length:g} {unit}"


def area_text(area_m2: float) -> str:
    """An area with a readable unit.

    Examples
    --------
    >>> area_text(512.3), area_text(29000.0), area_text(31e6)
    ('512 m²', '2.9 ha', '31 km²')
    """
    if area_m2 < 10_000:
        return f"{area_m2:.0f} m²"
    return f"{area_m2 / 1e4:.3g} ha" if area_m2 < 1e7 else f"{area_m2 / 1e6:.3g} km²"


def draw_scale_bar(ax: Any, frame: Frame, point: float) -> None:
    """Draw a scale bar in the lower left corner: in ground metres, or in map units where these are not known.

    Parameters
    ----------
    ax : matplotlib Axes
    frame : Frame
    point : float
        Length of one point (1/72 inch) in plot coordinates.
    """
    from matplotlib.patches import Rectangle

    (left, right), bottom = ax.get_xlim(), ax.get_ylim()[0]
    metres_per_unit, name = (
        (frame.metres_per_unit, "m") if frame.metres_per_unit else (1.0, _local_unit(frame))
    )
    length = bar_length((right - left) * metres_per_unit)
    width, height, room = length / metres_per_unit, 5 * point, 7 * point
    x, y = left + 2.4 * room, bottom + 2.4 * room
    back = Rectangle(
        (x - room, y - room), width + 2 * room, 4.3 * room, color=PAPER_COLOR, alpha=0.78, lw=0, zorder=8
    )
    ax.add_patch(back)
    for quarter in range(4):
        color = TEXT_COLOR if quarter % 2 == 0 else PAPER_COLOR
        corner = (x + quarter * width / 4, y)
        ax.add_patch(Rectangle(corner, width / 4, height, fc=color, ec=TEXT_COLOR, lw=0.6, zorder=9))
    text = length_text(length, name)
    ax.text(
        x + width / 2, y + 8 * point, text, ha="center", va="bottom", size=7.5, color=TEXT_COLOR, zorder=9
    )


def _local_unit(frame: Frame) -> str:
    return "px" if frame.geobox.transform.is_identity else "units"


def draw_north_arrow(ax: Any, frame: Frame, point: float) -> None:
    """Draw a north arrow in the upper right corner if there is a CRS; `point` as in `draw_scale_bar`."""
    if frame.north is None:
        return
    from matplotlib.patches import Circle, Polygon

    radius = 17 * point
    middle = np.array([ax.get_xlim()[1] - 1.5 * radius, ax.get_ylim()[1] - 1.5 * radius])
    ahead = np.array(frame.north) * radius
    aside = np.array([-ahead[1], ahead[0]]) * 0.34
    tip, notch, tail = middle + 0.16 * ahead, middle - 0.5 * ahead, middle - 0.8 * ahead
    ax.add_patch(Circle(tuple(middle), radius, color=PAPER_COLOR, alpha=0.78, lw=0, zorder=8))
    ax.add_patch(Polygon([tip, tail + aside, notch, tail - aside], color=TEXT_COLOR, lw=0, zorder=9))
    ax.text(
        *(middle + 0.5 * ahead),
        "N",
        ha="center",
        va="center",
        size=7,
        weight="bold",
        color=TEXT_COLOR,
        zorder=9,
    )
