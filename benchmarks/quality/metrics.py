"""Segmentation metrics against the ground truth: IoU, boundary F, variation of information, and others."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.metrics import variation_of_information

Mask = NDArray[np.bool_]
TOLERANCE = 2.0  # pixels


@dataclass(frozen=True, slots=True)
class Metrics:
    """Metrics of one result.

    Parameters
    ----------
    iou : float
        Intersection over union; best is 1.
    boundary_f : float
        Harmonic mean of precision and recall of boundary pixels within 2 pixels; best is 1
        (Martin, Fowlkes and Malik 2004, without their one-to-one matching).
    vi : float
        Variation of information between the partitions into connected regions and background, in bits;
        best is 0 (Meila 2007; computed with scikit-image).
    region_ratio : float
        Connected regions found per true region; best is 1.
    area_error : float
        Absolute error of the area, as a share of the true area; best is 0.
    """

    iou: float
    boundary_f: float
    vi: float
    region_ratio: float
    area_error: float


def measure(found: Mask, truth: Mask, valid: Mask) -> Metrics:
    """All metrics of a result; invalid pixels are not counted.

    Parameters
    ----------
    found, truth, valid : (M, N) bool array
    """
    found, truth = found & valid, truth & valid
    (parts, count), (true_parts, true_count) = ndimage.label(found), ndimage.label(truth)
    splits, merges = variation_of_information(true_parts[valid], parts[valid])
    area, true_area = int(found.sum()), int(truth.sum())
    return Metrics(
        iou(found, truth),
        boundary_f(found, truth, valid),
        float(splits + merges),
        count / max(true_count, 1),
        abs(area - true_area) / max(true_area, 1),
    )


def iou(found: Mask, truth: Mask) -> float:
    """Intersection over union; 1 where both are empty.

    Examples
    --------
    >>> iou(np.array([True, True, False]), np.array([False, True, True]))
    0.3333333333333333
    """
    either = int((found | truth).sum())
    return int((found & truth).sum()) / either if either else 1.0


def boundary_f(found: Mask, truth: Mask, valid: Mask, tolerance: float = TOLERANCE) -> float:
    """Harmonic mean of precision and recall of boundary pixels, within `tolerance` pixels.

    Examples
    --------
    >>> square = np.zeros((9, 9), bool)
    >>> square[2:5, 2:5] = True
    >>> everywhere = np.ones_like(square)
    >>> boundary_f(square, square, everywhere), boundary_f(square, np.roll(square, 4, (0, 1)), everywhere)
    (1.0, 0.0)
    """
    one, other = boundary(found, valid), boundary(truth, valid)
    if not one.any() or not other.any():
        return float(one.any() == other.any())
    precision, recall = _share_within(one, other, tolerance), _share_within(other, one, tolerance)
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def boundary(mask: Mask, valid: Mask) -> Mask:
    """Pixels of a mask that are 4-adjacent to a valid pixel outside the mask.

    Examples
    --------
    >>> boundary(np.array([[1, 1, 1, 0]], bool), np.ones((1, 4), bool)).astype(int)
    array([[0, 0, 1, 0]])
    """
    return np.asarray(mask & ndimage.binary_dilation(valid & ~mask))


def _share_within(pixels: Mask, others: Mask, tolerance: float) -> float:
    return float((ndimage.distance_transform_edt(~others)[pixels] <= tolerance).mean())
