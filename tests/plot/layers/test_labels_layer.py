"""Layer of labels: contours of what `original` and `--labels` write, refused inputs."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st

from tests.plot.layers.maps import BOX, LOCAL, MOST, beliefs, rgb, write
from uavseg.errors import RasterError
from uavseg.plot.layers.raster_layers import LabelsLayer, contours_of
from uavseg.plot.page.page import Frame
from uavseg.plot.preview import preview
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset


def thirds() -> np.ndarray:
    """Three segments side by side, none below."""
    found = np.zeros((128, 192), np.uint32)
    found[:96] = np.repeat([1, 70_000, 3], 64)
    return found


@settings(max_examples=40)
@given(st.integers(0, 2**32))
def test_contours_are_as_long_as_the_edges_of_segments(seed: int) -> None:
    field = np.random.default_rng(seed).choice([0, 1, 2, 2**32 - 1], (9, 14)).astype(np.uint32)
    box = GeoBox(field.shape, Affine(2, 0, 30, 0, -2, 70), None)
    layer = LabelsLayer.of(Dataset.of_values(field, box, "labels"), Frame(box), MOST)
    framed = np.pad(field, 1)
    edges = sum(
        int(((one != other) * ((one > 0).astype(int) + (other > 0))).sum())
        for one, other in ((framed[1:], framed[:-1]), (framed[:, 1:], framed[:, :-1]))
    )
    length = sum(
        np.hypot(*np.diff(line, axis=0).T).sum() for line in contours_of(layer.labels, layer.plot_from_pixel)
    )
    assert length == pytest.approx(2 * edges)


@pytest.mark.slow
def test_segments_are_outlined_in_white_on_dark_and_on_light_ground(tmp_path: Path) -> None:
    labels = write(tmp_path / "labels.tif", thirds(), nodata=0)
    for ground, width in product((0.0, 1.0), (900, 300)):  # lines, and pixels where they are small
        raster = write(tmp_path / f"{ground}.tif", np.full((128, 192), ground, np.float32))
        out = tmp_path / f"{ground} {width}"
        plain, lined = (
            rgb(preview(raster, f"{out}{n}.png", labels=given, stretch="none", width_px=width))
            for n, given in enumerate((None, labels))
        )
        drawn = (plain != lined).any(axis=2)
        assert np.ptp(lined[drawn]) > 150
        drawn = drawn[lined.shape[0] // 3]
        left = np.flatnonzero(drawn) / len(drawn)
        for border in (1 / 3, 2 / 3):  # of the raster, which is framed
            assert np.abs(left - (0.036 + border * 0.928)).min() < 0.01


def test_the_title_counts_segments_and_says_where_it_cannot_see_all() -> None:
    dataset = Dataset.of_values(thirds(), BOX, "labels")
    assert LabelsLayer.of(dataset, Frame(BOX), MOST).title_parts(True) == ["3 segments"]
    assert LabelsLayer.of(dataset, Frame(BOX), 200).title_parts(True) == ["at least 3 segments"]
    one = Dataset.of_values(np.ones((128, 192), np.uint8), BOX, "labels")
    assert LabelsLayer.of(one, Frame(BOX), MOST).title_parts(True) == ["1 segment"]


def test_rasters_without_labels_are_refused(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", beliefs())
    for wrong, message in (
        (raster, "uavseg original"),
        (write(tmp_path / "b.tif", thirds().astype(np.int32) - 1), "uavseg original"),
        (write(tmp_path / "c.tif", thirds(), LOCAL), "coordinate system"),
    ):
        with pytest.raises(RasterError, match=message):
            preview(raster, tmp_path / "out.png", labels=wrong)
        assert not (tmp_path / "out.png").exists()
