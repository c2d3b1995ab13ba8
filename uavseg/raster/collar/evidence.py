"""Evidence that constant pixels at the edge of a raster are a collar: their rim, border and the picture."""

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.raster.collar.flood import flood
from uavseg.raster.collar.rim import RimCounts
from uavseg.raster.grid.pixel_mask import ALL, PixelMask
from uavseg.raster.grid.tiling import Window, sample_positions
from uavseg.units import BLOCK

MAX_POINTS = 20_000
_ANGLES = np.deg2rad(np.arange(0, 180, 0.5))


def straight_share(points: NDArray[np.float64], tolerance: float, length: float, max_lines: int = 8) -> float:
    """Return the share of points, (n, 2) rows and columns, that lie on a few straight lines.

    They are at most `tolerance` pixels from a line, and those of a line extend at least over `length`.

    Examples
    --------
    >>> across = np.column_stack([np.arange(100), np.full(100, 7)]).astype(float)
    >>> straight_share(across, 1, 50), straight_share(across, 1, 200)
    (1.0, 0.0)
    """
    left = points
    for _ in range(max_lines):
        if len(left) < 2:
            break
        on_line, extent = _best_line(left, tolerance)
        if extent < length:
            break
        left = left[~on_line]
    return 1 - len(left) / max(len(points), 1)


def outline_points(mask: PixelMask, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return pixels of a set with a neighbour beside them that is not in it, evenly thinned to 20 000.

    They are (n, 2) rows and columns, in raster order of blocks.
    """
    rows, cols = np.nonzero(_blocks_at_outline(mask))
    found = [np.zeros((0, 2), np.int64)]
    for row, col in zip(rows.tolist(), cols.tolist(), strict=True):
        block = Window(row * BLOCK, col * BLOCK, BLOCK, BLOCK).clipped(shape)
        around = block.grown(1).clipped(shape)
        inside = mask.read(around)
        wide = np.pad(inside, 1, mode="edge")
        inner = wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:]
        own = Window(block.row - around.row, block.col - around.col, block.rows, block.cols).slices
        found.append(np.argwhere((inside & ~inner)[own]) + np.array([block.row, block.col]))
    points = np.concatenate(found)
    step = -(-len(points) // MAX_POINTS) if len(points) else 1
    return points[::step].astype(np.float64)


def _blocks_at_outline(mask: PixelMask) -> NDArray[np.bool_]:
    """Return blocks that may hold pixels at the outline: mixed ones, and whole ones beside others."""
    whole = np.pad(mask.codes == ALL, 1, mode="edge")
    inner = whole[:-2, 1:-1] & whole[2:, 1:-1] & whole[1:-1, :-2] & whole[1:-1, 2:]
    result: NDArray[np.bool_] = (mask.codes != 0) & ~inner
    return result


def _best_line(points: NDArray[np.float64], tolerance: float) -> tuple[NDArray[np.bool_], float]:
    """Return the points on the line with most of them, and how far these extend."""
    center = points.mean(axis=0)
    row, col = (points - center).T
    best, normal, offset = -1, 0.0, 0.0
    for angle in _ANGLES.tolist():
        rho = np.floor((row * np.cos(angle) + col * np.sin(angle)) / tolerance).astype(np.int64)
        least = int(rho.min())
        counts = np.bincount(rho - least)
        peak = int(counts.argmax())
        if counts[peak] > best:
            best, normal, offset = int(counts[peak]), angle, (peak + least + 0.5) * tolerance
    near = np.abs(row * np.cos(normal) + col * np.sin(normal) - offset) <= tolerance
    on_line = _fitted(points, near, tolerance)
    along = points[on_line] @ _direction(points[on_line])
    return on_line, float(along.max() - along.min()) if len(along) else 0.0


def _fitted(points: NDArray[np.float64], near: NDArray[np.bool_], tolerance: float) -> NDArray[np.bool_]:
    """Return points near the line of total least squares through some of them."""
    for _ in range(2):
        middle = points[near].mean(axis=0)
        along = _direction(points[near])
        across = (points - middle) @ np.array([-along[1], along[0]])
        near = np.abs(across) <= tolerance
        if not near.any():
            break
    return near


def _direction(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit vector of the largest variance."""
    away = points - points.mean(axis=0)
    vector: NDArray[np.float64] = np.linalg.eigh(away.T @ away)[1][:, -1]
    return vector


CORNERS_AROUND = 3  # held by what surrounds a picture
EDGE_AROUND = 0.5  # share of the edge of the raster that it covers
ONE_PIECE = 0.97  # share of the picture in its largest piece
COARSE = 1024  # rows and columns at which pieces are looked at


@dataclass(frozen=True, slots=True)
class Lines:
    """What a straight border is."""

    most: int  # number of lines
    share: float  # least share of the border on them
    tolerance: float  # pixels from a line


SHARP = Lines(8, 0.75, 2.0)
SMEARED = Lines(4, 0.9, 4.0)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a collar.

    Each line of a straight border is at least an eighth of the shorter side of the raster, and sixteen times
    the tolerance.
    """

    is_textured: bool  # this and the next three: of `RimCounts`
    is_smeared: bool
    is_speckled: bool
    fades: bool
    is_straight: bool  # a few straight lines hold most of the border, see `Lines`
    is_around: bool  # it holds three corners or more
    is_all_around: bool  # all four, and half of the edge of the raster
    is_one_piece: bool  # 97 % of the picture are connected

    @classmethod
    def of(
        cls, counts: RimCounts, mask: PixelMask, shape: tuple[int, int], corners: int, one_piece: bool
    ) -> "Evidence":
        """Judge by histograms of the rim, the pixels, the raster's shape, corners held, and pieces."""
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
    """Return whether nearly all that is not in a set is connected, at a coarse scale.

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
    """Return share of the pixels at the edge of a raster that are in a set."""
    rows, cols = shape
    sides = (
        Window(0, 0, 1, cols),
        Window(rows - 1, 0, 1, cols),
        Window(0, 0, rows, 1),
        Window(0, cols - 1, rows, 1),
    )
    return sum(int(mask.read(side).sum()) for side in sides) / (2 * (rows + cols))
