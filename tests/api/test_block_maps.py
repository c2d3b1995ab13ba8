"""Block maps and warnings in Python: as the commands treat them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from geopandas.testing import assert_geodataframe_equal

import uavseg
from uavseg.cli import main
from uavseg.errors import ParameterError


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a raster without CRS, and its block map."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(7)
    image = np.kron(rng.integers(30, 230, (6, 8)), np.ones((24, 24))) + rng.normal(0, 4, (144, 192))
    with rasterio.open(
        "tile.tif", "w", "GTiff", 192, 144, 1, dtype="uint8", transform=Affine(2, 0, 0, 0, -2, 288)
    ) as file:
        file.write(image.clip(0, 255).astype(np.uint8), 1)
    done = CliRunner().invoke(main, ["divide", "tile.tif", "-o", "blocks.tif", "-q"])
    assert done.exit_code == 0, done.output
    return tmp_path


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*coordinates are local")
def test_a_block_map_is_answered_as_its_raster() -> None:
    for one, other in (("blocks.tif", "tile.tif"), (Path("blocks.tif"), "tile.tif")):
        found, known = (uavseg.extract(source, (0.4, 0.8)) for source in (one, other))
        assert len(known) > 2
        assert_geodataframe_equal(found, known)
        segments, levels = (uavseg.levels(source, 0.25) for source in (one, other))
        assert len(levels) > 9
        assert_geodataframe_equal(segments, levels)
        segments, levels = (uavseg.levels(source, 0.25, refine="none") for source in (one, other))
        assert len(levels) > 9 and segments["std"].isna().all()
        assert_geodataframe_equal(segments.drop(columns="std"), levels.drop(columns="std"))


def test_a_block_map_without_its_raster_is_answered_at_block_edges_with_a_warning(folder: Path) -> None:
    (folder / "tile.tif").rename(folder / "other.tif")
    with pytest.warns(UserWarning, match=r"tile\.tif is not where it was, so regions end at block edges"):
        found = uavseg.extract("blocks.tif", (0.4, 0.8))
    assert len(found) > 2 and found["std"].isna().all()


@pytest.mark.parametrize(
    ("word", "how", "refusal"),
    [
        ("match", {"like": (100, 100, 40)}, "a block map holds no texture to be compared"),
        ("classify", {}, r"blocks\.tif is a block map; states are refined with the map"),
        ("path", {"range": (0, 1), "start": (9, 9), "goal": (50, 50)}, r"blocks\.tif is a block map"),
        ("divide", {}, "a block map is divided already"),
        ("extract", {"range": (0, 1), "band": 2}, "a block map has its bands, nodata and stretch already"),
        ("levels", {"width": 0.2, "nodata": 0}, "a block map has its bands, nodata and stretch already"),
        ("suggest", {"stretch": "minmax"}, "a block map has its bands, nodata and stretch already"),
    ],
)
def test_what_a_block_map_cannot_answer_is_refused(word: str, how: dict[str, Any], refusal: str) -> None:
    with pytest.raises(ParameterError, match=refusal):
        getattr(uavseg, word)("blocks.tif", **how)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("word", "how"),
    [
        ("extract", {"range": (0.4, 0.8)}),
        ("levels", {"width": 0.25}),
        ("match", {"like": (100, 100, 70)}),
        ("suggest", {"classes": 2}),
        ("divide", {}),
        ("classify", {}),
        ("path", {"range": (0, 1), "start": (9, 9), "goal": (50, 50)}),
    ],
)
def test_every_word_warns_of_what_is_wrong_with_a_raster(word: str, how: dict[str, Any]) -> None:
    with pytest.warns(UserWarning, match=r"tile\.tif: it has no coordinate reference system") as caught:
        getattr(uavseg, word)("tile.tif", **how)
    local = [one for one in caught if "coordinate reference system" in str(one.message)]
    assert len(local) == 1 and local[0].filename == __file__


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*coordinates are local")
@pytest.mark.parametrize(
    ("word", "how", "hint"),
    [
        ("extract", {"range": (0.9999, 1)}, r"no region has a mean v in 0\.9999\.\.1"),
        ("levels", {"width": 0.2, "min_area": "1e9px", "small": "drop"}, "no segment is left"),
        ("match", {"like": (100, 100, 70), "min_area": "1e9px"}, "nothing is like the sample"),
    ],
)
def test_nothing_found_is_a_warning(word: str, how: dict[str, Any], hint: str) -> None:
    with pytest.warns(UserWarning, match=hint):
        assert len(getattr(uavseg, word)("tile.tif", **how)) == 0
