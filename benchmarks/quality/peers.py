"""Peer methods: usual segmentations of a scene into a mask, with the same range where a method uses one.

Invalid pixels are excluded from means and superpixels where a method supports it; elsewhere they are black.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.filters import threshold_otsu
from skimage.restoration import denoise_tv_chambolle
from skimage.segmentation import chan_vese as chan_vese_of, felzenszwalb, random_walker, slic

from benchmarks.quality.camera import Mask
from benchmarks.quality.planes import Plane
from benchmarks.quality.scenes import RANGE, Scene

_MARKER_MARGIN = 0.08  # of v: pixels at least this far from the lower bound of the range are markers
_DEFAULT_SEGMENTS = 100  # scikit-image's for SLIC


def blur_threshold(scene: Scene, sigma: float) -> Mask:
    """Gaussian blur over the valid pixels, then the range."""
    return _in_range(scene, _blur(scene, sigma))


def otsu(scene: Scene, sigma: float) -> Mask:
    """Otsu's threshold (1979) of the blurred image; the range is not used."""
    image = _blur(scene, sigma)
    return np.asarray(image > threshold_otsu(image[scene.valid]))


def felzenszwalb_segments(scene: Scene, scale: float, sigma: float, min_size: int) -> Mask:
    """Felzenszwalb and Huttenlocher's segments (2004) whose mean is in range."""
    image = np.nan_to_num(scene.v)
    return _by_mean(scene, felzenszwalb(image, scale, sigma, min_size, channel_axis=None))


def slic_segments(scene: Scene, pixels: float | None, compactness: float, sigma: float) -> Mask:
    """SLIC superpixels (Achanta et al. 2012) of about `pixels` pixels whose mean is in range."""
    count = _DEFAULT_SEGMENTS if pixels is None else int(scene.valid.sum() / pixels)
    mask = None if scene.valid.all() else scene.valid
    image = np.nan_to_num(scene.v)
    segments = slic(image, count, compactness, sigma=sigma, channel_axis=None, mask=mask, start_label=0)
    return _by_mean(scene, segments)


def random_walk(scene: Scene, beta: float, sigma: float) -> Mask:
    """The random walker (Grady 2006); markers are blurred pixels well above or below the lower bound."""
    image = _blur(scene, sigma)
    markers = np.zeros(image.shape, np.int8)
    markers[image < RANGE[0] - _MARKER_MARGIN] = 1
    markers[image > RANGE[0] + _MARKER_MARGIN] = 2
    markers[~scene.valid] = -1
    if not {1, 2} <= set(np.unique(markers)):
        return np.asarray(markers == 2)
    return np.asarray(random_walker(np.nan_to_num(scene.v), markers, beta) == 2)


def chan_vese(scene: Scene, mu: float) -> Mask:
    """The phases of Chan and Vese (2001) whose mean is in range."""
    image = np.where(scene.valid, scene.v, np.nanmean(scene.v))
    return _by_mean(scene, chan_vese_of(image, mu).astype(np.intp))


def denoised(scene: Scene, times: float) -> Mask:
    """Total-variation denoising (Chambolle 2004), weighted by `times` the estimated noise, then the range."""
    image = np.where(scene.valid, scene.v, np.nanmean(scene.v))
    weight = times * noise_of(image)
    return _in_range(scene, denoise_tv_chambolle(image, weight) if weight > 0 else image)


def noise_of(image: Plane) -> float:
    """Estimated standard deviation of the noise of an image (Immerkaer 1996).

    Examples
    --------
    >>> noise_of(np.add.outer(np.arange(9.0), np.arange(9.0)))  # a linear ramp has no noise
    0.0
    """
    operator = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]])
    response = ndimage.convolve(image, operator)[1:-1, 1:-1]
    return float(np.sqrt(np.pi / 2) / 6 * np.abs(response).mean())


def _blur(scene: Scene, sigma: float) -> Plane:
    """Gaussian-weighted means over valid pixels; 0 where invalid or where all weights are 0."""
    weights = ndimage.gaussian_filter(scene.valid.astype(float), sigma)
    sums = ndimage.gaussian_filter(np.nan_to_num(scene.v), sigma)
    return np.asarray(np.divide(sums, weights, out=np.zeros_like(sums), where=scene.valid))


def _in_range(scene: Scene, image: Plane) -> Mask:
    return (image >= RANGE[0]) & (image <= RANGE[1]) & scene.valid


def _by_mean(scene: Scene, segments: NDArray[np.intp]) -> Mask:
    """Segments (numbered from 0; -1 is no segment) whose mean over their valid pixels is in range."""
    labels = (segments[scene.valid] + 1).ravel()
    sums = np.bincount(labels, scene.v[scene.valid], segments.max() + 2)
    means = sums / np.maximum(np.bincount(labels, minlength=len(sums)), 1)
    return _in_range(scene, means[segments + 1])
