"""Where the next sample would help most: on valid ground, outside of all samples, in undecided colors."""

import json
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

import uavseg
from tests.jobs.test_match_by_color import DISC, SHAPE, overlap, painted, picture, write
from uavseg.cli import main
from uavseg.execution.executors import threads
from uavseg.jobs.match.match import Match, match
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.regions.sample.place import Disc, sample_mask

LEFT = Disc(1044, 900, 10)
SHADES = (60, 75, 160)  # the field of the sample, one that is little brighter, and another


def fields(shape: tuple[int, int] = SHAPE, seed: int = 0) -> NDArray[np.uint8]:
    """Three fields side by side; whether the second one is of the kind of the first is open."""
    kind = np.minimum(np.indices(shape)[1] * 3 // shape[1], 2)
    noise = np.random.default_rng(seed).normal(0, 6, shape)
    return np.rint(np.clip(np.array(SHADES)[kind] + noise, 1, 255)).astype(np.uint8)[None]


@pytest.fixture
def tile(tmp_path: Path) -> Path:
    return write(tmp_path / "fields.tif", fields())


def found(path: Path, *like: Disc, unlike: tuple[Disc, ...] = (), work: Work = SERIAL) -> Match:
    return match(open_raster(str(path)), MatchRequest(like or LEFT, by="color", unlike=unlike), work)


def mask_of(path: Path, disc: Disc) -> NDArray[np.bool_]:
    """The pixels of a disc in the whole raster."""
    geobox = open_raster(str(path)).geobox
    place = sample_mask(disc, geobox)
    whole = np.zeros(geobox.shape, bool)
    part = place.window.clipped(geobox.shape)
    whole[part.slices] = place.part(part)
    return whole


@pytest.mark.slow
def test_it_lies_in_the_field_that_is_undecided(tile: Path) -> None:
    proposed = found(tile).next_sample
    assert proposed is not None and proposed.radius == LEFT.radius
    inside = np.argwhere(mask_of(tile, proposed))
    assert inside[:, 1].min() >= 88 and inside[:, 1].max() < 176


@pytest.mark.slow
def test_the_line_that_it_proposes_decides(tile: Path) -> None:
    proposed = found(tile).next_sample
    assert proposed is not None
    left = np.indices(SHAPE)[1]
    both, alone = found(tile, LEFT, proposed), found(tile, LEFT, unlike=(proposed,))
    assert overlap(painted(both), left < 176) > 0.95 and overlap(painted(alone), left < 88) > 0.9


@pytest.mark.slow
def test_where_all_is_decided_nothing_is_proposed(tmp_path: Path) -> None:
    made = found(write(tmp_path / "tile.tif", picture()), DISC)
    assert made.next_sample is None and made.advice is None
    assert "next_sample" not in made.found.regions.metadata


@pytest.mark.parametrize("words", [{"by": "texture"}, {"window": 16}])
def test_texture_proposes_nothing(tile: Path, words: dict[str, object]) -> None:
    frame = uavseg.match(tile, (1044, 900, 30), **words)
    assert "next_sample" not in frame.attrs["uavseg"]


@pytest.mark.slow
@pytest.mark.parametrize("refine", ["pixel", "none"])
def test_tiles_and_threads_change_nothing(tile: Path, refine: str) -> None:
    request = MatchRequest(LEFT, by="color", refine=refine)
    one = match(open_raster(str(tile)), request)
    other = match(open_raster(str(tile)), request, Work(64, threads(2)))
    assert one.next_sample is not None and one.next_sample == other.next_sample
    assert one.found.regions.metadata == other.found.regions.metadata


def with_holes(folder: Path, rng: np.random.Generator, seed: int) -> tuple[Path, NDArray[np.uint8]]:
    """The fields with holes of nodata, none of which is in the sample."""
    planes = fields(seed=seed)
    for _ in range(4):
        row, col = rng.integers(0, 180), rng.integers(60, 240)
        planes[0, row : row + 60, col : col + 40] = 0
    path = write(folder / "tile.tif", planes)
    with rasterio.open(path, "r+") as file:
        file.nodata = 0
    return path, planes


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=6)
def test_it_lies_on_valid_pixels_and_outside_of_all_samples(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    path, planes = with_holes(tmp_path_factory.mktemp("holes"), np.random.default_rng(seed), seed)
    samples = [LEFT]
    for _ in range(3):
        made = found(path, *samples)
        if made.next_sample is None:
            break
        inside = mask_of(path, made.next_sample)
        assert inside.sum() >= 64 and (planes[0][inside] != 0).all()
        assert abs(inside.sum() - math.pi * made.next_sample.radius**2) < 0.1 * inside.sum()
        assert not any((inside & mask_of(path, sample)).any() for sample in samples)
        samples.append(made.next_sample)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("transform", "epsg"),
    [
        (Affine(0.000005, 0, 12, 0, -0.000005, 48), 4326),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in [
                (Affine(0.02, 0, 5e5, 0, -0.02, 5e6), 32633),
                (Affine(0.3, 0.2, 5e5, 0.2, -0.3, 5e6), 32633),
                (Affine(30, 0, 5e5, 0, -20, 5e6), 32633),
                (Affine(1, 0, 0, 0, -1, 200), None),
            ]
        ),
    ],
)
def test_on_any_map_it_is_as_large_as_the_sample(tmp_path: Path, transform: Affine, epsg: int | None) -> None:
    path = tmp_path / "tile.tif"
    size = {"count": 1, "height": SHAPE[0], "width": SHAPE[1], "dtype": "uint8"}
    with rasterio.open(
        path, "w", "GTiff", **size, transform=transform, crs=None if epsg is None else f"EPSG:{epsg}"
    ) as file:
        file.write(fields())
    x, y = transform * (44, 100)
    first = Disc(x, y, 12 * math.sqrt(abs(transform.determinant)) * (92000 if epsg == 4326 else 1))
    proposed = found(path, first).next_sample
    assert proposed is not None
    inside, own = mask_of(path, proposed), mask_of(path, first)
    assert 0.75 < inside.sum() / own.sum() < 1.25
    cols = np.argwhere(inside)[:, 1]
    assert cols.min() >= 88 and cols.max() < 176
    assert max(len(f"{value:.15g}") for value in (proposed.x, proposed.y, proposed.radius)) < 13


@pytest.mark.slow
def test_an_array_has_its_own_coordinates() -> None:
    frame = uavseg.match(fields()[0], (44, 100, 10), by="color")
    x, y, radius = frame.attrs["uavseg"]["next_sample"]
    assert 88 + radius <= x <= 176 - radius and radius <= y <= SHAPE[0] - radius


@pytest.mark.slow
def test_typing_the_proposed_line_works(tile: Path, tmp_path: Path) -> None:
    line = [
        "match",
        str(tile),
        "--like",
        "1044,900,10",
        "--by",
        "color",
        "--overwrite",
        "-o",
        str(tmp_path / "r.gpkg"),
    ]
    first = CliRunner().invoke(main, line)
    assert first.exit_code == 0, first.output
    said = re.search(
        r"^undecided is what lies at (\S+), (\S+): look there, and add (--like \S+) or (--unlike \S+)$",
        first.stderr,
        re.MULTILINE,
    )
    assert said is not None and said[3].startswith(f"--like {said[1]},{said[2]},")
    for more in (said[3], said[4]):
        again = CliRunner().invoke(main, [*line, *shlex.split(more)])
        assert again.exit_code == 0, again.output
        assert f"lies at {said[1]}, {said[2]}:" not in again.stderr


@pytest.mark.slow
def test_python_and_the_command_say_the_same(tile: Path, tmp_path: Path) -> None:
    target = tmp_path / "found.geojson"
    line = ["match", str(tile), "--like", "1044,900,10", "--by", "color", "-o", str(target)]
    said = CliRunner().invoke(main, line)
    frame = uavseg.match(str(tile), (1044, 900, 10), by="color")
    proposed = frame.attrs["uavseg"]["next_sample"]
    assert json.loads(target.read_text())["uavseg"]["next_sample"] == proposed
    assert f"--unlike {','.join(f'{value:.15g}' for value in proposed)}" in said.stderr


@pytest.mark.slow
def test_a_quiet_command_does_not_say_it(tile: Path, tmp_path: Path) -> None:
    target = str(tmp_path / "found.gpkg")
    said = CliRunner().invoke(
        main, ["match", str(tile), "--like", "1044,900,10", "--by", "color", "-q", "-o", target]
    )
    assert said.exit_code == 0 and said.output == ""


@pytest.mark.slow
def test_the_line_is_not_in_a_stream_of_regions(tile: Path) -> None:
    said = CliRunner().invoke(main, ["match", str(tile), "--like", "1044,900,10", "--by", "color", "-o", "-"])
    assert said.stdout.startswith("{") and "undecided is" not in said.stdout and "undecided is" in said.stderr
