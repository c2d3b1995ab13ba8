"""Flat fields: `extract --flatten` on drawn scenes under slow light, without it, and on labelled pictures.

    python -m benchmarks.flatten [FOLDER]

Each method gets the range with the largest intersection over union (of 72 ranges that are open at one end).
FOLDER has pictures NAME.tif with truth NAME_truth.tif.
"""

import sys
import time
import warnings
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.features import rasterize
from scipy import ndimage

import uavseg

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Scene = tuple[Image, Mask]
SIDE = 512
WIDTHS = None, "32px", "64px", "128px", "256px", "512px"
SEEDS = 3


def _grain(rng: np.random.Generator, scale: float) -> NDArray[np.float64]:
    field: NDArray[np.float64] = ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), scale)
    field /= field.std()
    return field


def _light(rng: np.random.Generator) -> NDArray[np.float64]:
    """Vignetting and a slope, together 0.1 to 0.4 of v."""
    row, col = np.mgrid[:SIDE, :SIDE] / SIDE - 0.5
    strength, angle = rng.uniform(0.1, 0.3), rng.uniform(0, 2 * np.pi)
    return np.asarray(strength * (row * np.sin(angle) + col * np.cos(angle) - 2 * (row**2 + col**2)))


def _picture(v: NDArray[np.float64]) -> Image:
    return np.clip(255 * v, 0, 255).astype(np.uint8)


def cracks(rng: np.random.Generator, lit: bool) -> Scene:
    """Dark walks of 2 or 3 pixels on textured ground."""
    truth = np.zeros((SIDE, SIDE), bool)
    for _ in range(4):
        place, heading = rng.uniform(0, SIDE, 2), rng.uniform(0, 2 * np.pi)
        for _ in range(900):
            heading += rng.normal(0, 0.12)
            place += np.sin(heading), np.cos(heading)
            if (place >= 0).all() and (place < SIDE).all():
                truth[tuple(place.astype(int))] = True
    truth = ndimage.binary_dilation(truth, np.ones((2, 2) if rng.random() < 0.5 else (3, 3)))
    soft = ndimage.gaussian_filter(truth.astype(float), 0.6)
    v = (
        0.65
        + lit * _light(rng)
        + 0.04 * _grain(rng, 0)
        + 0.03 * _grain(rng, 2)
        - rng.uniform(0.1, 0.2) * soft
    )
    return _picture(v), truth


def spots(rng: np.random.Generator, lit: bool) -> Scene:
    """Dark discs of 10 to 30 pixels."""
    row, col = np.mgrid[:SIDE, :SIDE]
    truth = np.zeros((SIDE, SIDE), bool)
    for middle in rng.uniform(0, SIDE, (30, 2)):
        truth |= np.hypot(row - middle[0], col - middle[1]) < rng.uniform(5, 15)
    v = (
        0.65
        + lit * _light(rng)
        + 0.05 * _grain(rng, 0)
        + 0.03 * _grain(rng, 2)
        - rng.uniform(0.1, 0.2) * truth
    )
    return _picture(v), truth


def halves(rng: np.random.Generator, lit: bool) -> Scene:
    """Two kinds of ground in large patches, half of the picture each."""
    field = _grain(rng, 30)
    truth = field > np.median(field)
    return _picture(0.6 + lit * _light(rng) + 0.05 * _grain(rng, 0) - rng.uniform(0.1, 0.2) * truth), truth


FAMILIES = {"cracks": cracks, "spots": spots, "large patches": halves}


def labelled(folder: Path) -> dict[str, Scene]:
    """The pictures of a folder, in grey."""
    found = {}
    for path in sorted(folder.glob("*_truth.tif")):
        with rasterio.open(path) as one, rasterio.open(str(path).replace("_truth", "")) as other:
            truth, bands = one.read(1) > 0, other.read()
        grey = bands[:3].mean(axis=0)
        found[path.name.removesuffix("_truth.tif")] = _picture((grey - grey.min()) / np.ptp(grey)), truth
    return found


def best_iou(scene: Scene, flatten: str | None) -> float:
    """IoU of the best range."""
    image, truth = scene
    best = 0.0
    for bound in np.linspace(0.15, 0.85, 36):
        for interval in (0, bound), (bound, 1):
            regions = uavseg.extract(image, interval, flatten=flatten)
            if len(regions):
                found = rasterize(regions.geometry, truth.shape, dtype="uint8") > 0
                best = max(best, float((found & truth).sum() / (found | truth).sum()))
    return best


def seconds() -> str:
    """Processor time of `extract` without and with a flat field, in pairs; medians."""
    image = np.tile(cracks(np.random.default_rng(0), True)[0], (8, 8))
    times: dict[str | None, list[float]] = {None: [], "64px": [], "1024px": []}
    for _ in range(5):
        for width in times:
            start = time.process_time()
            uavseg.extract(image, (0, 0.4), flatten=width, threads=1)
            times[width].append(time.process_time() - start)
    each = [f"{width or 'none'} {np.median(found[1:]):.2f} s" for width, found in times.items()]
    return f"CPU, {image.shape[0]} x {image.shape[1]} pixels, by width: {', '.join(each)}"


def main(folder: str | None) -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    print("| | " + " | ".join(width or "off" for width in WIDTHS) + " |\n|---|" + "---:|" * len(WIDTHS))
    rows = {
        f"{name}, {'slow' if lit else 'even'} light": [
            draw(np.random.default_rng(seed), lit) for seed in range(SEEDS)
        ]
        for lit in (True, False)
        for name, draw in FAMILIES.items()
    }
    rows |= {name: [scene] for name, scene in (labelled(Path(folder)) if folder else {}).items()}
    for name, scenes in rows.items():
        means = [np.mean([best_iou(scene, width) for scene in scenes]) for width in WIDTHS]
        print(f"| {name} | {' | '.join(f'{mean:.3f}' for mean in means)} |", flush=True)
    print(seconds())


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
