"""Evidence that constant pixels at the edge of a raster are a collar: their rim, border and the picture."""

from dataclasses import dataclass

import numpy as np

from uavseg.raster.collar.pixel_mask import PixelMask
from uavseg.raster.collar.rim import RimCounts
from uavseg.raster.collar.spread import flood
from uavseg.raster.collar.straight import outline_points, straight_share
from uavseg.raster.tiling import sample_positions

CORNERS_AROUND = 3  # held by what surrounds a picture
STRAIGHT, STRAIGHT_SMEARED = 0.75, 0.9  # least share of the border on straight lines
TOLERANCE, TOLERANCE_SMEARED = 2.0, 4.0  # pixels from a line
ONE_PIECE = 0.99  # share of the picture in its largest piece
COARSE = 1024  # rows and columns at which pieces are looked at


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a collar.

    Parameters
    ----------
    is_textured, is_smeared, is_speckled, fades : bool
        Of `RimCounts`.
    is_straight : bool
        Whether at most eight straight lines, each at least an eighth of the shorter side of the raster (and
        32 pixels, or 64 if smeared), hold three quarters of the border, or nine tenths if it is smeared.
    is_around, is_all_around : bool
        Whether three corners or more are held, or all four.
    is_one_piece : bool
        Whether 99 % of the picture are connected.
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
    def of(cls, counts: RimCounts, mask: PixelMask, shape: tuple[int, int], corners: int) -> "Evidence":
        """From the histograms of the rim, the pixels, the raster's shape and how many corners are held."""
        smeared = counts.is_smeared
        tolerance = TOLERANCE_SMEARED if smeared else TOLERANCE
        straight = straight_share(outline_points(mask, shape), tolerance, max(min(shape) / 8, 16 * tolerance))
        return cls(
            counts.is_textured,
            smeared,
            counts.is_speckled,
            counts.fades,
            straight >= (STRAIGHT_SMEARED if smeared else STRAIGHT),
            corners >= CORNERS_AROUND,
            corners == 4,
            _is_one_piece(mask, shape),
        )

    @property
    def is_collar(self) -> bool:
        """Whether it is a collar beyond doubt.

        A sharp step to a textured picture leaves the shape to decide; a smeared one has to have the picture
        in one piece too; and beside a picture that is nearly black or white itself, all of it is required.
        """
        if self.fades or self.is_speckled:
            return False
        if not self.is_textured:
            return self.is_straight and self.is_all_around and self.is_one_piece
        if self.is_smeared:
            return self.is_one_piece and (self.is_straight or self.is_around)
        return self.is_straight or (self.is_around and self.is_one_piece)

    @property
    def may_be_collar(self) -> bool:
        """Whether the user should decide."""
        sharp = not (self.fades or self.is_speckled)
        return sharp and self.is_one_piece and (self.is_straight or self.is_around)


def _is_one_piece(mask: PixelMask, shape: tuple[int, int]) -> bool:
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
