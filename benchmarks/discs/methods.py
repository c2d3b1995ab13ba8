"""Methods that learn what is wanted from one disc within it, or from that and three on other ground."""

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks import likeness, samples
from benchmarks.match import cooccurrence, disc_of
from benchmarks.samples import Samples

Find = Callable[[Samples], Any]


def one_disc(find: Callable[[likeness.Query], Any]) -> Find:
    """A method of `benchmarks.likeness`, which gets the disc within what is wanted."""
    return lambda asked: find(likeness.Query(asked.path, asked.image, asked.truth, asked.like[0]))


def or_nothing(find: Find) -> Find:
    """A method that finds nothing where uavseg refuses a sample as too small."""
    from uavseg.errors import SampleError

    def found(asked: Samples) -> Any:
        try:
            return find(asked)
        except SampleError:
            return np.zeros_like(asked.truth)

    return found


def by_features(asked: Samples) -> Any:
    """scikit-image's trainable segmentation: features of all bands at sigma 1 to 16, and a random forest."""
    from skimage.feature import multiscale_basic_features

    planes = np.moveaxis(asked.image.astype(float), 0, -1)
    return _by_forest(multiscale_basic_features(planes, sigma_min=1, sigma_max=16, channel_axis=-1), asked)


def by_cooccurrence(asked: Samples) -> Any:
    """Co-occurrence features of windows as wide as the disc, their mean colors, and a random forest."""
    from scipy.ndimage import uniform_filter

    half = int(min(16, max(4, asked.like[0][2])))
    textures = cooccurrence(_grey(asked.image), half)[: asked.truth.shape[0], : asked.truth.shape[1]]
    colors = uniform_filter(asked.image.astype(float), (0, 2 * half, 2 * half))
    return _by_forest(np.concatenate([textures, np.moveaxis(colors, 0, -1)], -1), asked)


def by_one_class(asked: Samples) -> Any:
    """scikit-learn's one-class support vector machine on colors that are blurred by a pixel."""
    from scipy.ndimage import gaussian_filter
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import OneClassSVM

    colors = np.moveaxis(gaussian_filter(asked.image.astype(float), (0, 1, 1)), 0, -1)
    model = make_pipeline(StandardScaler(), OneClassSVM(nu=0.05, gamma="scale"))
    model.fit(colors[_union(asked.like, asked.truth.shape)])
    return model.predict(colors.reshape(-1, len(asked.image))).reshape(asked.truth.shape) > 0


def _by_forest(features: Any, asked: Samples) -> Any:
    """Pixels that a forest assigns to the disc rather than to those on other ground."""
    from sklearn.ensemble import RandomForestClassifier

    inside, outside = (_union(discs, asked.truth.shape) for discs in (asked.like, asked.unlike))
    forest = RandomForestClassifier(
        n_estimators=50, max_depth=10, class_weight="balanced", random_state=0, n_jobs=1
    )
    forest.fit(
        np.concatenate([features[inside], features[outside]]),
        np.arange(inside.sum() + outside.sum()) < inside.sum(),
    )
    return forest.predict(features.reshape(-1, features.shape[-1])).reshape(asked.truth.shape)


def _union(discs: list[samples.Place], shape: tuple[int, int]) -> Any:
    return np.any([disc_of(shape, disc) for disc in discs], axis=0)


def _grey(image: Any) -> Any:
    return np.rint(np.tensordot([0.2126, 0.7152, 0.0722], image, 1)).astype(np.uint8)


METHODS: dict[str, Find] = {
    "match": one_disc(likeness.by_match),
    "grey ± 3 deviations": one_disc(likeness.by_deviations),
    "GrabCut": one_disc(likeness.by_grabcut),
    "one-class SVM": by_one_class,
    "match --unlike*": or_nothing(samples.by_match),
    "features, forest*": by_features,
    "GLCM, forest*": by_cooccurrence,
}
"""By title; those with a star get the discs on other ground too."""

_REQUIRED = {
    "grey ± 3 deviations": "skimage",
    "GrabCut": "cv2",
    "one-class SVM": "sklearn",
    "features, forest*": "sklearn",
    "GLCM, forest*": "sklearn",
}


def skipped() -> dict[str, str]:
    """Why methods cannot run, by title."""
    return {
        name: f"Python has no {module}"
        for name, module in _REQUIRED.items()
        if importlib.util.find_spec(module) is None
    }
