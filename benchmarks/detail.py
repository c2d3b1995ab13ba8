"""The wanted scale: `extract --detail` against morphology and areas, on drawn shapes and labelled pictures.

    python -m benchmarks.detail [FOLDER]

Drawn: a river, its quay, discs and islands in noise, joined by necks, cut by gaps and covered with roads of
1 to 6 pixels that are not in the truth. FOLDER has pictures NAME.tif with truth NAME_truth.tif; the range is
that of 5 to 95 % of the truth's pixels. Every method gets the regions of the same `extract`.
"""

import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import rasterio.features
from numpy.typing import NDArray
from scipy import ndimage

import uavseg
from uavseg.segmentation.refine.detail import PixelDisc

Mask = NDArray[np.bool_]
SIDE = 9  # pixels
NOISES = 0.05, 0.15, 0.25
SEEDS = 4
_AREA = SIDE * SIDE * 4


def drawn(seed: int) -> tuple[Mask, Mask]:
    """The truth, and the same with necks, gaps and lines narrower than the detail."""
    rng = np.random.default_rng(seed)
    row, col = np.mgrid[:360, :480].astype(float)
    truth = np.abs(row - 90 - 20 * np.sin(col / 50 + seed)) < rng.uniform(12, 24)
    truth |= (row > 150) & (row < 150 + rng.uniform(20, 40)) & (col < 300)
    for k in range(6):
        radius, middle = rng.uniform(12, 28), 40 + 80 * k
        truth |= np.hypot(row - 280, col - middle) < radius
    seen = truth.copy()
    for middle in rng.uniform(20, 460, 6):
        seen |= np.abs(col - middle) < rng.uniform(0.6, 3)  # roads and necks
    for middle in rng.uniform(20, 340, 3):
        seen &= np.abs(row - middle - 0.2 * col + 40) > rng.uniform(0.6, 2.5)  # gaps
    return truth, seen


def _disc(side: int) -> Mask:
    return PixelDisc(side, side).pixels


def _open_close(mask: Mask) -> Mask:
    return np.asarray(ndimage.binary_closing(ndimage.binary_opening(mask, _disc(SIDE)), _disc(SIDE)))


def _close_open(mask: Mask) -> Mask:
    return np.asarray(ndimage.binary_opening(ndimage.binary_closing(mask, _disc(SIDE)), _disc(SIDE)))


def _majority(mask: Mask) -> Mask:
    disc = _disc(2 * SIDE + 1).astype(float)
    share = ndimage.convolve(mask.astype(float), disc / disc.sum(), mode="nearest")
    return np.asarray(share > 0.5)


def _extracted(image: NDArray[np.uint8], interval: tuple[float, float], **how: Any) -> Mask:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        regions = uavseg.extract(image, interval, threads=1, **how)
    if not len(regions):
        return np.zeros(image.shape, bool)
    return np.asarray(rasterio.features.rasterize(regions.geometry, image.shape) > 0)


METHODS: dict[str, Callable[[NDArray[np.uint8], tuple[float, float]], Mask]] = {
    "extract": lambda image, interval: _extracted(image, interval),
    f"extract --detail {SIDE}px": lambda image, interval: _extracted(image, interval, detail=f"{SIDE}px"),
    f"--fill-holes {_AREA}px --min-area {_AREA}px": lambda image, interval: _extracted(
        image, interval, fill_holes=f"{_AREA}px", min_area=f"{_AREA}px"
    ),
    "opening, then closing": lambda image, interval: _open_close(_extracted(image, interval)),
    "closing, then opening": lambda image, interval: _close_open(_extracted(image, interval)),
    f"majority in a disc of {2 * SIDE + 1}": lambda image, interval: _majority(_extracted(image, interval)),
}


def iou(found: Mask, truth: Mask) -> float:
    """Intersection over union."""
    return float((found & truth).sum() / max((found | truth).sum(), 1))


def drawn_row(method: Callable[..., Mask]) -> list[str]:
    """IoU and found per true region, at each noise."""
    cells = []
    for noise in NOISES:
        scores, ratios = [], []
        for seed in range(SEEDS):
            truth, seen = drawn(seed)
            grey = 0.42 + 0.26 * seen + np.random.default_rng(seed).normal(0, noise, seen.shape)
            image = np.clip(255 * grey, 0, 255).astype(np.uint8)
            found = method(image, (0.55, 1))
            scores.append(iou(found, truth))
            ratios.append(ndimage.label(found)[1] / ndimage.label(truth)[1])
        cells.append(f"{np.mean(scores):.3f} / {np.mean(ratios):.2f}")
    return cells


def labelled_row(method: Callable[..., Mask], folder: Path) -> list[str]:
    """Mean IoU and mean number of regions of the labelled pictures."""
    scores, counts = [], []
    for path in sorted(folder.glob("*_truth.tif")):
        with rasterio.open(path) as one, rasterio.open(str(path).replace("_truth", "")) as other:
            truth, bands = one.read(1) > 0, other.read()
        grey = bands[:3].mean(axis=0)
        scaled = (255 * (grey - grey.min()) / np.ptp(grey)).astype(np.uint8)
        low, high = np.percentile(scaled[truth], [5, 95]) / 255
        found = method(scaled, (float(low), float(max(high, low + 0.01))))
        scores.append(iou(found, truth))
        counts.append(ndimage.label(found)[1])
    return [f"{np.mean(scores):.3f} / {np.mean(counts):.0f}"]


def seconds() -> str:
    """Processor time of `extract` with and without details, in pairs; medians."""
    image = np.tile(np.clip(255 * (0.42 + 0.26 * drawn(0)[1]), 0, 255).astype(np.uint8), (8, 6))
    image = (image + np.random.default_rng(0).integers(0, 30, image.shape)).astype(np.uint8)
    details = None, "3px", "9px", "30px"
    times: dict[str | None, list[float]] = {detail: [] for detail in details}
    for _ in range(6):
        for detail in details:
            start = time.process_time()
            uavseg.extract(image, (0.55, 1), detail=detail, threads=1)
            times[detail].append(time.process_time() - start)
    each = [f"{detail or 'none'} {np.median(times[detail][1:]):.2f} s" for detail in details]
    return f"CPU, {image.shape[0]} x {image.shape[1]} pixels, by detail: {', '.join(each)}"


def main(folder: str | None) -> None:
    """Print the table."""
    heads = ["", *(f"drawn, noise {noise:g}" for noise in NOISES)] + (["labelled"] if folder else [])
    print("| " + " | ".join(heads) + " |\n|---|" + "---:|" * (len(heads) - 1))
    for name, method in METHODS.items():
        row = drawn_row(method) + (labelled_row(method, Path(folder)) if folder else [])
        print(f"| {name} | {' | '.join(row)} |", flush=True)
    print(seconds())


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
