"""Connectivity 8: the components of eight neighbours of the same pixels, whatever tiles, threads and way."""

import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from rasterio.features import shapes
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skimage.measure import label

import uavseg
from tests.jobs.test_band_statistics import write
from tests.jobs.test_pixels import SHAPES, answer, drawn, speckled
from uavseg.errors import ParameterError

RANGE = (0.55, 1)
WAYS: list[dict[str, Any]] = [
    {"refine": "tv"},
    {"refine": "pixels"},
    {"refine": "pixels", "fill_holes": "9px"},
    {"refine": "scan", "detail": "3px"},
    {"refine": "smooth", "thin_lines": True},
]
extracted = partial(uavseg.extract, range=RANGE)
eight = partial(uavseg.extract, range=RANGE, connectivity=8)


def partition(labels: NDArray[Any]) -> NDArray[np.int64]:
    """Labels 0..n numbered by their first pixels, so that equal partitions are equal arrays."""
    names, firsts, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.where(names == 0, -1, firsts)
    return (np.argsort(np.argsort(rank)) + (0 not in names))[inverse].reshape(labels.shape)


def assert_joined(one: Any, other: Any, kinds: NDArray[Any]) -> None:
    """Regions `other` are the components of eight neighbours of the kinds of `one`, with their sums."""
    labels, parts = (drawn(found, found["id"], kinds.shape).astype(int) for found in (other, one))
    assert np.array_equal(partition(labels), partition(label(kinds, background=0, connectivity=2)))
    assert other["id"].tolist() == [*range(1, len(other) + 1)] and (np.diff(other["pixels"]) <= 0).all()
    assert shapely.is_valid(other.geometry.to_numpy()).all()
    owners, places = np.unique(parts, return_index=True)
    of = labels.reshape(-1)[places[owners > 0]] - 1
    pixels, mean, std = (one[name] for name in ("pixels", "mean", "std"))
    sums = {name: one[name] for name in ("area_m2", "perimeter_m", "pixels", "holes")}
    for name, column in sums.items():
        assert np.allclose(np.bincount(of, column, len(other)), other[name])
    assert np.allclose(np.bincount(of, pixels * mean, len(other)), other["pixels"] * other["mean"])
    squares = np.bincount(of, pixels * (mean**2 + std**2), len(other))
    assert np.allclose(squares, other["pixels"] * (other["mean"] ** 2 + other["std"] ** 2))


@pytest.mark.slow
@settings(max_examples=12)
@given(st.integers(0, 10**6), SHAPES, st.sampled_from(WAYS))
def test_regions_are_the_components_of_eight_neighbours(
    seed: int, shape: tuple[int, int], how: dict[str, Any]
) -> None:
    image = speckled(seed, shape)
    one, other = (answer(uavseg.extract, image, RANGE, **how, connectivity=n) for n in (4, 8))
    mask = drawn(one, np.ones(len(one)), shape).astype(np.uint8)
    assert_joined(one, other, mask)
    assert len(other) == len(list(shapes(mask, mask=mask > 0, connectivity=8)))


@pytest.mark.slow
@settings(max_examples=6)
@given(st.integers(0, 10**6), SHAPES, st.sampled_from(["tv", "pixels"]))
def test_classes_and_levels_are_joined_within_themselves(
    seed: int, shape: tuple[int, int], refine: str
) -> None:
    image = speckled(seed, shape)
    ways = {
        "class": partial(uavseg.extract, classes={"dark": (0.1, 0.4), "bright": (0.4, 0.8)}),
        "level": partial(uavseg.levels, width=0.3),
    }
    for column, way in ways.items():
        one, other = (answer(way, image, refine=refine, connectivity=n) for n in (4, 8))
        codes = {name: k for k, name in enumerate(one[column].unique(), start=1)}
        kinds = drawn(one, one[column].map(codes), shape)
        assert np.array_equal(drawn(other, other[column].map(codes), shape), kinds)
        assert_joined(one, other, kinds.astype(int))


def test_segments_that_touch_once_small_ones_are_merged_are_joined() -> None:
    """The single pixel becomes part of what is nearest to it, which then touches the lower right."""
    text = "aaabb aaabb aasba bbbaa bbbaa"
    values = {"a": 51, "s": 90, "b": 220}
    image = np.array([[values[c] for c in row] for row in text.split()], np.uint8)
    found = answer(uavseg.levels, image, 0.3, refine="pixels", min_area="2px", connectivity=8)
    assert found["pixels"].tolist() == [14, 11] and found["level"].tolist() == [0, 2]
    assert found.geom_type.tolist() == ["MultiPolygon"] * 2


@pytest.mark.slow
@settings(max_examples=6)
@given(st.integers(0, 10**6), SHAPES)
def test_merged_segments_are_components_of_eight_neighbours(seed: int, shape: tuple[int, int]) -> None:
    image = speckled(seed, shape)
    found = answer(uavseg.levels, image, 0.3, refine="pixels", min_area="9px", connectivity=8)
    kinds = drawn(found, found["level"] + 1, shape).astype(int)
    labels = label(kinds, background=0, connectivity=2)
    assert np.array_equal(partition(drawn(found, found["id"], shape)), partition(labels))


@pytest.mark.slow
@pytest.mark.parametrize("refine", ["tv", "pixels", "none"])
def test_tiles_and_threads_change_nothing(refine: str) -> None:
    image = speckled(7, (300, 290))
    assert len(answer(eight, image, refine=refine)) < len(answer(extracted, image, refine=refine))
    found = [
        answer(eight, image, refine=refine, tile=tile, threads=threads)
        for tile, threads in ((None, 1), (64, 1), (128, 3))
    ]
    for other in found[1:]:
        assert found[0].equals(other)
        assert found[0].geometry.to_wkb().tolist() == other.geometry.to_wkb().tolist()


def test_cells_that_touch_at_a_corner_are_one_region() -> None:
    image = np.full((192, 192), 20, np.uint8)
    image[:64, :64] = image[64:128, 64:128] = 220
    one, other = (answer(uavseg.extract, image, RANGE, refine="none", connectivity=n) for n in (4, 8))
    assert [len(one), len(other)] == [2, 1] and other["pixels"].tolist() == [2 * 64**2]


def test_small_regions_are_dropped_once_they_are_joined() -> None:
    image = np.full((40, 40), 20, np.uint8)
    for k in range(6):
        image[4 + k, 30 - k] = 250
    image[30, 5:9] = 250
    how: dict[str, Any] = {"refine": "pixels", "min_area": "5px"}
    assert answer(eight, image, **how)["pixels"].tolist() == [6]
    assert len(answer(extracted, image, **how)) == 0


def test_holes_are_those_of_polygons_and_are_filled_before() -> None:
    """Four pixels around one enclose it by corners alone: no hole, and it stays."""
    image = np.full((40, 40), 20, np.uint8)
    image[9, 10] = image[11, 10] = image[10, 9] = image[10, 11] = 250
    image[20:25, 20:25] = 250
    image[22, 22] = 20
    found = answer(eight, image, refine="pixels", fill_holes="9px")
    assert found["pixels"].tolist() == [25, 4] and found["holes"].tolist() == [0, 0]


def test_connectivity_is_4_or_8() -> None:
    image = speckled(1, (20, 20))
    for number in (0, 6, -8):
        with pytest.raises(
            ParameterError, match=rf"connectivity is 4 \(edges\) or 8 \(corners too\), not {number}"
        ):
            uavseg.extract(image, RANGE, connectivity=number)
    many: Any = "many"
    with pytest.raises(ParameterError, match="connectivity is a whole number, not 'many'"):
        uavseg.levels(image, 0.3, connectivity=many)


def test_statistics_of_bands_are_of_the_whole_region(tmp_path: Path) -> None:
    pytest.importorskip("exactextract", reason="exactextract is not installed")
    image = np.stack([speckled(5, (90, 100)).clip(1), speckled(6, (90, 100)).clip(1)])
    path = write(tmp_path / "a.tif", image, nodata=0)
    found = uavseg.extract(path, RANGE, band=1, refine="pixels", connectivity=8, stats="bands")
    names = [name for name in found if name.startswith(("mean_", "min_", "max_")) and name != "mean_value"]
    labels = label((image[0] / 255 >= RANGE[0]), connectivity=2)
    assert len(found) == labels.max() and len(names) == 6
    largest = labels == np.argmax(np.bincount(labels.ravel())[1:]) + 1
    for band, name in enumerate(sorted(name for name in names if name.startswith("mean_"))):
        assert found[name][0] == pytest.approx(image[band][largest].mean())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("imagery/naip_potholes_2015.tif", {"band": 4, "range": (0, 0.35)}),
        ("imagery/uav_forest_snow_clearing_mask.tif", {"rgb": (1, 2, 3), "range": RANGE}),
        ("labelled/pond0.tif", {"range": RANGE}),
    ],
)
def test_real_rasters_have_the_components_of_eight_neighbours(
    shared_data: Path, name: str, how: dict[str, Any]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        one, other = (
            uavseg.extract(shared_data / name, **how, refine="pixels", connectivity=n) for n in (4, 8)
        )
    touching = one.sindex.query(one.geometry, predicate="touches")  # regions of four neighbours, at points
    graph = coo_array((np.ones(touching.shape[1]), touching), shape=(len(one), len(one)))
    assert len(other) == connected_components(graph, directed=False)[0] < len(one)
    assert other.geometry.is_valid.all() and other["pixels"].sum() == one["pixels"].sum()
    assert shapely.get_num_geometries(other.geometry.to_numpy()).sum() == len(one)
