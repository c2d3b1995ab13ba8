"""A block map in a notebook: a picture of the means of its cells."""

import base64
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rasterio.io import MemoryFile

from uavseg.segmentation.blocks.block_map import _MAX_SIDE, BlockMap, _thumbnail


def picture(address: str) -> NDArray[Any]:
    kind, _, text = address.partition(",")
    assert kind == "data:image/png;base64"
    with MemoryFile(base64.b64decode(text)) as file, file.open() as image:
        read: NDArray[Any] = image.read()
    return read


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
@pytest.mark.parametrize("shape", [(3, 5), (360, 7), (361, 10), (1, 1000)])
def test_the_picture_has_the_means_of_squares(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    counts = rng.integers(0, 65, shape).astype(np.uint8)
    counts[0, 0] = 0
    sums = (counts * rng.integers(0, 65536, shape)).astype(np.uint32)
    grey, alpha = picture(_thumbnail(sums, counts, 65535.0))
    step = max(1, -(-max(shape) // _MAX_SIDE))
    assert grey.shape == tuple(-(-side // step) for side in shape) and max(grey.shape) <= _MAX_SIDE
    for row, col in np.ndindex(*grey.shape):
        square = (slice(row * step, (row + 1) * step), slice(col * step, (col + 1) * step))
        number = int(counts[square].sum(dtype=np.int64))
        assert alpha[row, col] == (255 if number else 0)
        if number:
            assert abs(grey[row, col] - sums[square].sum(dtype=np.int64) / number / 257) <= 0.51


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
def test_a_block_map_shows_its_cells_without_what_extends_past_the_image() -> None:
    blocks = BlockMap.empty((100, 70))
    assert "no valid pixel" in blocks._repr_html_()
    blocks.sums[:7, :] = 64 * 65535
    blocks.counts[:7, :] = 64
    html = blocks._repr_html_()
    assert "100 x 70 pixels: 2 x 2 blocks" in html
    [address] = re.findall(r'src="([^"]*)"', html)
    grey, alpha = picture(address)
    assert grey.shape == (13, 9)
    assert (alpha[:7] == 255).all() and (grey[:7] == 255).all() and not alpha[7:].any()
