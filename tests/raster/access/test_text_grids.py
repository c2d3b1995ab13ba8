"""A VRT of a text grid that ends early is refused: GDAL would look for its last row 2^n times."""

from pathlib import Path

import numpy as np
import pytest

from uavseg.errors import RasterReadError
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset

VRT = """<VRTDataset rasterXSize="20" rasterYSize="90"><GeoTransform>4e5, 1, 0, 5e6, 0, -1</GeoTransform>
<VRTRasterBand dataType="Int32" band="1"><SimpleSource>
<SourceFilename relativeToVRT="1">a.asc</SourceFilename><SourceBand>1</SourceBand>
</SimpleSource></VRTRasterBand></VRTDataset>"""


@pytest.mark.parametrize("rows", [90, 70])
def test_a_vrt_of_a_text_grid_needs_all_of_its_rows(tmp_path: Path, rows: int) -> None:
    lines = [" ".join(str(row + col) for col in range(20)) for row in range(rows)]
    head = "ncols 20\nnrows 90\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    (tmp_path / "a.asc").write_text(head + "\n".join(lines) + "\n")
    path = tmp_path / "a.vrt"
    path.write_text(VRT)
    if rows < 90:
        with pytest.raises(RasterReadError, match=r"a\.vrt names .*a\.asc, which cannot be read as a whole"):
            Dataset.open(path)
        return
    values, _ = Dataset.open(path).read(Window(80, 0, 10, 20))
    assert np.array_equal(values[0], np.add.outer(np.arange(80, 90), np.arange(20)))
