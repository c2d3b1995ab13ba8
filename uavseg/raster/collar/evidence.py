"""Evidence that constant pixels at the edge of a raster are a collar: their rim, border and the picture."""

from dataclasses import dataclass

import numpy as np

from uavseg.raster.collar.rim import RimCounts
from uavseg.raster.collar.spread import flood
from uavseg.raster.collar.straight import outline_points, straight_share
from uavseg.raster.grid.pixel_mask import PixelMask
from uavseg.raster.grid.tiling import Window, sample_positions

CORNERS_AROUND = 3  # held by what surrounds a picture
EDGE_AROUND = 0.5  # share of the edge of the raster that it covers
ONE_PIECE = 0.97  # share of the picture in its largest piece
COARSE = 1024  # rows and columns at which pieces are looked at


@dataclass(frozen=True, slots=True)
class Lines:
    """What a straight border is.

    Parameters
    ----------
    most : int
        Number of lines.
    share : float
        Least share of the border on them.
    tolerance : float
        Pixels from a line.
    """

    most: int
    share: float
    tolerance: float


SHARP = Lines(8, 0.75, 2.0)
SMEARED = Lines(4, 0.9, 4.0)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a collar.

    Parameters
    ----------
    is_textured, is_smeared, is_speckled, fades : bool
        Of `RimCounts`.
    is_straight : bool
        Whether a few straight lines hold most of the border, see `Lines`; each is at least an eighth of the
        shorter side of the raster, and sixteen times the tolerance.
    is_around, is_all_around : bool
        Whether it holds three corners or more, or all four, and half of the edge of the raster.
    is_one_piece : bool
        Whether 97 % of the picture are connected.
    """

    is_textured: bool
    is_smeared: bool
    is_speckled: bool
    fades: bool
    is_straight: bool
    is_around: bool
    is_all_around: bool
    is_one_piece: bool

    @classmethod
    def of(
        cls, counts: RimCounts, mask: PixelMask, shape: tuple[int, int], corners: int, one_piece: bool
    ) -> "Evidence":
        """From the histograms of the rim, the pixels, the raster's shape, corners held, and pieces."""
        lines = SMEARED if counts.is_smeared else SHARP
        straight = straight_share(
            outline_points(mask, shape),
            lines.tolerance,
            max(min(shape) / 8, 16 * lines.tolerance),
            lines.most,
        )
        along_edge = _share_of_edge(mask, shape) >= EDGE_AROUND
        return cls(
            counts.is_textured,
            counts.is_smeared,
            counts.is_speckled,
            counts.fades,
            straight >= lines.share,
            along_edge and corners >= CORNERS_AROUND,
            along_edge and corners == 4,
            one_piece,
        )

    @property
    def is_collar(self) -> bool:
        """Whether it is a collar beyond doubt.

        A sharp step to a textured picture leaves the shape to decide. A smeared one has to surround the
        picture, in one piece: a pale sky above a horizon fades like what JPEG smears. Beside a picture that
        is nearly black or white itself, all of it is required.
        """
        if self.fades or self.is_speckled:
            return False
        if not self.is_textured:
            return self.is_straight and self.is_all_around and self.is_one_piece
        if self.is_smeared:
            return self.is_one_piece and self.is_around
        return self.is_straight or (self.is_around and self.is_one_piece)

    @property
    def may_be_collar(self) -> bool:
        """Whether the user should decide."""
        sharp = not (self.fades or self.is_speckled)
        return sharp and self.is_one_piece and (self.is_straight or self.is_around)


def is_one_piece(mask: PixelMask, shape: tuple[int, int]) -> bool:
    """Whether nearly all that is not in a set is connected, at a coarse scale.

    If so, it is reached from one of the three pixels at the quartiles of it in raster order.
    """
    rows, cols = (sample_positions(0, length, min(length, COARSE)) for length in shape)
    picture = ~mask.sample(rows, cols)
    places = np.flatnonzero(picture)
    for quarter in (1, 2, 3) if len(places) else ():
        source = np.zeros(picture.shape, bool)
        source.flat[places[len(places) * quarter // 4]] = True
        if flood(source, picture).sum() >= ONE_PIECE * len(places):
            return True
    return False


def _share_of_edge(mask: PixelMask, shape: tuple[int, int]) -> float:
    """Share of the pixels at the edge of a raster that are in a set."""
    rows, cols = shape
    sides = (
        Window(0, 0, 1, cols),
        Window(rows - 1, 0, 1, cols),
        Window(0, 0, rows, 1),
        Window(0, cols - 1, rows, 1),
    )
    return sum(int(mask.read(side).sum()) for side in sides) / (2 * (rows + cols))
