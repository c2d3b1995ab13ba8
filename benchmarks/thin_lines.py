"""Thin lines: `extract --thin-lines` on drawn lines of 1 to 3 pixels in noise, and on noise alone.

    python -m benchmarks.thin_lines

Each method gets the range 0 to B with the largest intersection over union. A pixel found within a pixel of
the truth counts as right for precision.
"""

import time
import warnings

import numpy as np
from rasterio.features import rasterize
from scipy import ndimage

import uavseg
from benchmarks.flatten import SEEDS, SIDE, Image, Mask, _grain, _picture, cracks

NOISES = 0.03, 0.06, 0.1
CONTRAST = 0.15


def drawn(seed: int, width: int, noise: float, grain: float) -> tuple[Image, Mask]:
    """Dark lines of a width on ground of noise, which is white or has a grain of some pixels."""
    rng = np.random.default_rng(seed)
    truth = np.zeros((SIDE, SIDE), bool)
    for _ in range(5):
        place, heading = rng.uniform(0, SIDE, 2), rng.uniform(0, 2 * np.pi)
        for _ in range(600):
            heading += rng.normal(0, 0.06)
            place += np.sin(heading), np.cos(heading)
            if (place >= 0).all() and (place < SIDE).all():
                truth[tuple(place.astype(int))] = True
    if width > 1:
        truth = ndimage.binary_dilation(truth, np.ones((width, width)))
    return _picture(0.6 + noise * _grain(rng, grain) - CONTRAST * truth), truth


def found_in(image: Image, high: float, thin_lines: bool, flatten: str | None = None) -> tuple[Mask, int]:
    """Pixels of the regions, and their number."""
    regions = uavseg.extract(image, (0, high), thin_lines=thin_lines, flatten=flatten)
    if not len(regions):
        return np.zeros(image.shape, bool), 0
    return rasterize(regions.geometry, image.shape, dtype="uint8") > 0, len(regions)


def best(
    image: Image, truth: Mask, thin_lines: bool, flatten: str | None = None
) -> tuple[float, float, float, float]:
    """IoU of the best range, with recall, precision and regions for each true component."""
    near, results = ndimage.binary_dilation(truth, np.ones((3, 3))), [(0.0, 0.0, 0.0, 0.0)]
    for high in np.linspace(0.2, 0.6, 27):
        found, count = found_in(image, float(high), thin_lines, flatten)
        if found.any():
            right = found & truth
            shares = (
                right.sum() / (found | truth).sum(),
                right.sum() / truth.sum(),
                (found & near).sum() / found.sum(),
            )
            pieces = count / ndimage.label(truth, np.ones((3, 3)))[1]
            results.append((float(shares[0]), float(shares[1]), float(shares[2]), float(pieces)))
    return max(results)


def row(name: str, scenes: list[tuple[Image, Mask]], flatten: str | None = None) -> None:
    """Print the means of both methods."""
    cells = []
    for thin_lines in (False, True):
        means = np.mean([best(*scene, thin_lines, flatten) for scene in scenes], axis=0)
        cells.append(" / ".join(f"{mean:.2f}" for mean in means[:3]) + f" / {means[3]:.1f}")
    print(f"| {name} | {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Print the tables."""
    warnings.simplefilter("ignore")
    print("| IoU / recall / precision / regions | extract | --thin-lines |\n|---|---:|---:|")
    for grain in (0.0, 1.5):
        for width in (1, 2, 3):
            for noise in NOISES:
                name = f"{width} px, {'grain' if grain else 'noise'} {noise:g}"
                row(name, [drawn(seed, width, noise, grain) for seed in range(SEEDS)])
    row(
        "cracks, slow light, --flatten 64px",
        [cracks(np.random.default_rng(k), True) for k in range(SEEDS)],
        "64px",
    )
    for grain in (0.0, 0.7, 1.5, 4.0):
        v = 0.6 + 0.08 * np.block([[_grain(np.random.default_rng(9 + k), grain) for k in range(4)]] * 1)
        image = _picture(v)
        shares = [
            (found_in(image, high, True)[0] & ~found_in(image, high, False)[0]).mean()
            for high in (0.5, 0.56, 0.59)
        ]
        print(f"noise alone, grain {grain:g}: share of pixels added {max(shares):.1e}", flush=True)
    image = np.tile(drawn(0, 2, 0.06, 0)[0], (4, 4))
    for thin_lines in (False, True):
        start = time.process_time()
        found_in(image, 0.5, thin_lines)
        print(f"CPU, {image.shape}, thin lines {thin_lines}: {time.process_time() - start:.2f} s")


if __name__ == "__main__":
    main()
