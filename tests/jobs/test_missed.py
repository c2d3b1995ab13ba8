"""Where nothing is found though pixels are in range, the message counts them and names what finds them."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import uavseg
from tests.jobs.test_flatten import run, write
from tests.jobs.test_pixels import RANGE

PIXELS = "--refine pixels takes every pixel by its own value"


def told(source: Any, *given: Any, **how: Any) -> str:
    """The only warning of an answer without regions, beside that of a missing place."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert len(uavseg.extract(source, *given, **how)) == 0
    [text] = [str(one.message) for one in caught if "no coordinate reference system" not in str(one.message)]
    return text


def specks(shape: tuple[int, int] = (200, 300)) -> NDArray[np.uint8]:
    """Single bright pixels, far apart, on dark noise; 0 in the first 10 rows."""
    image = np.random.default_rng(0).integers(50, 70, shape, np.uint8)
    image[5::50, 5::50] = 200
    image[:10] = 0
    return image


@pytest.mark.slow
@pytest.mark.parametrize("tile", [None, 64])
@pytest.mark.parametrize("refine", ["tv", "scan", "smooth", "none"])
def test_pixels_in_range_are_counted(tmp_path: Path, tile: int | None, refine: str) -> None:
    image = specks()
    text = told(write(tmp_path / "a.tif", image), RANGE, refine=refine, tile=tile)
    assert text == (
        f"no region has a mean v in 0.55..1, although 18 of 57,000 pixels (0.0316 %) lie in it; {PIXELS}"
    )
    assert (image == 200).sum() == 18 and (image > 0).sum() == 57000


@pytest.mark.slow
def test_values_and_percentiles_are_counted_by_their_own_stretch(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", specks())
    assert "no region has a mean value in 150 and more" in (text := told(path, values=(150, None)))
    assert "although 18 of 57,000 pixels (0.0316 %) lie in it" in text
    assert "although 18 of 57,000 pixels" in told(path, percentile=(99.99, 100))


def test_the_option_that_is_named_finds_them(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", specks())
    assert PIXELS in told(path, RANGE)
    assert len(uavseg.extract(path, RANGE, refine="pixels")) == 18


def test_where_no_pixel_is_in_range_none_is_counted() -> None:
    image = np.full((100, 100), 60, np.uint8)
    wanted = "no region has a mean v in 0.55..1; uavseg info shows which v there are"
    assert told(image, RANGE).endswith(wanted) and told(image, RANGE, refine="pixels").endswith(wanted)


def test_lines_name_the_option_for_lines() -> None:
    rng, rows, cols = np.random.default_rng(0), *np.indices((150, 200))
    image = np.clip(np.where(abs(rows - 0.6 * cols) < 0.8, 130, 95) + rng.normal(0, 9, (150, 200)), 1, 255)
    with pytest.warns(UserWarning, match="--thin-lines finds lines of 1 to 3 pixels, and --refine pixels"):
        few = uavseg.extract(image.astype(np.uint8), (0.48, 0.6), min_confidence=None, refine="none")
    assert not len(few)
    assert "--thin-lines" not in told(specks(), RANGE)
    assert len(uavseg.extract(image.astype(np.uint8), (0.48, 0.6), refine="scan", thin_lines=True))


def test_regions_that_a_minimum_area_dropped_are_named() -> None:
    image = np.full((128, 128), 60, np.uint8)
    image[20:40, 20:40] = image[60:80, 20:40] = 200
    one = "the only region with a mean v in 0.55..1 is smaller than --min-area; a smaller one keeps more"
    both = "all 2 regions with a mean v in 0.55..1 are smaller than --min-area; a smaller one keeps more"
    assert both in told(image, RANGE, min_area="500px") and one in told(image[:50], RANGE, min_area="500px")
    assert both in told(image, RANGE, min_area="500px", refine="pixels")


def test_a_detail_that_left_all_out_is_named() -> None:
    image = np.full((128, 128), 60, np.uint8)
    image[60:64] = 200
    text = told(image, RANGE, detail="8px")
    assert (
        "and is 8 pixels wide, although 512 of 16,384 pixels (3.12 %) lie in it; a smaller --detail" in text
    )
    assert text.endswith(f"keeps more, and {PIXELS}")
    assert told(image, RANGE, detail="8px", refine="pixels").endswith("a smaller --detail keeps more")


def test_classes_without_a_region_are_counted_together() -> None:
    classes = {"ground": (0.1, 0.4), "bright": (0.7, 0.9), "none": (0.91, 1)}
    with pytest.warns(UserWarning) as caught:
        found = uavseg.extract(specks(), classes=classes, refine="none")
    assert set(found["class"]) == {"ground"}
    texts = [str(one.message) for one in caught]
    assert any(
        "no region of bright (0.7,0.9), none (0.91,1) is there, although 18 of 60,000 pixels (0.03 %) lie in "
        f"them; {PIXELS}" in text
        for text in texts
    )


def test_classes_that_a_minimum_area_dropped_are_named() -> None:
    image = np.full((128, 128), 60, np.uint8)
    image[20:40, 20:40] = 200
    with pytest.warns(UserWarning, match=r"all regions of bright \(0\.55,1\) are smaller than --min-area"):
        uavseg.extract(image, classes={"ground": (0.1, 0.4), "bright": RANGE}, min_area="500px")


def test_a_block_map_counts_in_its_raster_where_it_reads_it(tmp_path: Path) -> None:
    raster, blocks = write(tmp_path / "a.tif", specks()), str(tmp_path / "blocks.tif")
    run("divide", raster, "-o", blocks, "-q")
    assert "although 18 of 57,000 pixels" in told(blocks, RANGE)
    assert "although" not in told(blocks, RANGE, refine="none")
