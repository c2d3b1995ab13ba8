"""Figure of scenes beside the results of two refinements, with their errors in colour.

python -m benchmarks.quality.pictures docs/quality.jpg
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.quality.camera import Mask
from benchmarks.quality.ours import SETTINGS, extracted
from benchmarks.quality.scenes import FAMILIES, Scene, draw

SHOWN = ("islands, noise 0.05", "roads, noise 0.15", "terraces", "glint", "country", "blobs, noise 0.3")
COLUMNS = {"scene": None, "scans": "adaptive, scan", "total variation": "default"}
SIDE = 200  # pixels: side of the central part that is shown
MISSED, FALSE_POSITIVE = (0.9, 0.25, 0.2), (0.2, 0.45, 0.95)


def draw_figure(path: Path) -> None:
    """Draw the centre of a scene of each family: missed pixels in red, false positives in blue."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3 * len(COLUMNS), 3.2 * len(SHOWN)), layout="constrained")
    FigureCanvasAgg(figure)
    for row, family in zip(figure.subplots(len(SHOWN), len(COLUMNS)), SHOWN, strict=True):
        scene = draw(FAMILIES[family], 1)
        for ax, (title, setting) in zip(row, COLUMNS.items(), strict=True):
            mask = scene.truth if setting is None else extracted(scene, SETTINGS[setting])
            ax.imshow(_overlay(scene, mask, setting is not None), interpolation="nearest")
            iou = (
                ""
                if setting is None
                else f": IoU {(mask & scene.truth).sum() / (mask | scene.truth).sum():.3f}"
            )
            ax.set_title((family if setting is None else title) + iou, fontsize=10)
            ax.set_axis_off()
    figure.savefig(path, dpi=72)


def _overlay(
    scene: Scene, mask: Mask, with_errors: bool
) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    """The centre of a scene in grey, with the mask brighter and errors in colour."""
    part = scene.central_crop(SIDE)
    found = replace(scene, truth=mask).central_crop(SIDE).truth
    shown = np.repeat(np.nan_to_num(part.v)[..., None], 3, axis=2)
    if with_errors:
        shown = 0.35 + 0.3 * shown + 0.3 * found[..., None]
        shown[part.truth & ~found] = MISSED
        shown[found & ~part.truth] = FALSE_POSITIVE
    return np.clip(shown, 0, 1)


if __name__ == "__main__":
    draw_figure(Path(sys.argv[1]))
