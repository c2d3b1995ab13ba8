"""Scenes of two or more textures with equal mean and equal standard deviation of grey."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

SIDE = 512
MEAN, DEVIATION, NOISE = 0.5, 0.12, 0.02
RADIUS = 44  # pixels: largest radius of a sample

FAMILIES = {  # texture of the objects, textures of the background
    "rows in meadow": ("rows", ("meadow",)),
    "rows in sand": ("rows", ("sand",)),
    "meadow in rows": ("meadow", ("rows",)),
    "forest on sand": ("forest", ("sand",)),
    "forest in meadow": ("forest", ("meadow",)),
    "glint in meadow": ("glint", ("meadow",)),
    "rows across rows": ("rows", ("rows across",)),
    "rows in a patchwork": ("rows", ("meadow", "sand", "forest", "glint")),
}


@dataclass(frozen=True)
class Scene:
    """An image with its ground truth and two samples.

    Parameters
    ----------
    image : (512, 512) uint8 array
    truth : (512, 512) bool array
    sample, other : (int, int, int)
        Row, column and radius of a disc inside the ground truth, and of one in the background.
    """

    image: Any
    truth: Any
    sample: tuple[int, int, int]
    other: tuple[int, int, int]


def scene(family: str, seed: int, side: int = SIDE, own: float = 1, blobs: int = 12) -> Scene:
    """A reproducible scene of a family: blobs of one texture in a background of others.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.
    seed : int
    side : int
    own : float
        Share of the variance of blobs that is of their own texture; the rest is of that around them.
    blobs : int
        About how many blobs have room along a side.
    """
    import numpy as np
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    rng = np.random.default_rng([seed, list(FAMILIES).index(family)])
    objects, background = FAMILIES[family]
    field = gaussian_filter(rng.normal(size=(side, side)), side / blobs)
    truth = field > np.quantile(field, 0.6)
    selector = gaussian_filter(rng.normal(size=(len(background), side, side)), (0, side / 16, side / 16))
    image = np.choose(selector.argmax(axis=0), [texture(rng, name, side) for name in background])
    inside = MEAN + own**0.5 * (texture(rng, objects, side) - MEAN) + (1 - own) ** 0.5 * (image - MEAN)
    image = np.where(truth, inside, image) + rng.normal(0, NOISE, (side, side))
    discs = []
    for mask in (truth, ~truth):
        room = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
        row, col = np.unravel_index(int(room.argmax()), room.shape)
        discs.append((int(row), int(col), min(int(room.max()) - 2, RADIUS)))
    return Scene(np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8), truth, discs[0], discs[1])


def texture(rng: Any, name: str, side: int) -> Any:
    """A texture of mean 0.5 and standard deviation 0.12."""
    made = TEXTURES[name](rng, side)
    return MEAN + DEVIATION * (made - made.mean()) / made.std()


def _grain(rng: Any, side: int, sigma: float) -> Any:
    from scipy.ndimage import gaussian_filter

    return gaussian_filter(rng.normal(size=(side, side)), sigma)


def _sand(rng: Any, side: int) -> Any:
    return _grain(rng, side, 0.6)


def _meadow(rng: Any, side: int) -> Any:
    coarse, fine = _grain(rng, side, 2.0), _grain(rng, side, 0.8)
    return coarse / coarse.std() + 0.5 * fine / fine.std()


def _forest(rng: Any, side: int) -> Any:
    """Tree crowns: dark gaps between round tops."""
    import numpy as np

    made = -np.abs(_grain(rng, side, 3.0))
    return made / made.std() + 0.3 * rng.normal(size=made.shape)


def _glint(rng: Any, side: int) -> Any:
    """Bright points, elongated along rows."""
    import numpy as np
    from scipy.ndimage import gaussian_filter

    points = np.where(rng.random((side, side)) < 0.03, 1.0, 0.0)
    made = gaussian_filter(points, (0.7, 1.5))
    return made / made.std() + 0.2 * rng.normal(size=made.shape)


def _rows(direction: float) -> Callable[[Any, int], Any]:
    """Furrows, seven pixels apart, slightly curved."""

    def draw(rng: Any, side: int) -> Any:
        import numpy as np

        bend = _grain(rng, side, 20.0)
        row, col = np.mgrid[:side, :side]
        along = row * np.cos(direction) + col * np.sin(direction)
        return np.sin(along * 2 * np.pi / 7 + 0.6 * bend / bend.std()) + 0.4 * rng.normal(size=bend.shape)

    return draw


TEXTURES: dict[str, Callable[[Any, int], Any]] = {
    "sand": _sand,
    "meadow": _meadow,
    "forest": _forest,
    "glint": _glint,
    "rows": _rows(0.5),
    "rows across": _rows(2.0),
}
