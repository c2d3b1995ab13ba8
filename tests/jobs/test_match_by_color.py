"""Regions like a sample by colour: one small disc finds its kind, for any tiles, and says when it cannot."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

import uavseg
from uavseg.cli import main
from uavseg.errors import ParameterError, SampleError
from uavseg.execution.executors import threads
from uavseg.jobs.match.match import Match, match
from uavseg.jobs.match.request import ANSWERS, MatchRequest
from uavseg.jobs.source.open_source import open_all_bands, open_raster
from uavseg.jobs.source.work import Work
from uavseg.options.reading import ReadOptions
from uavseg.plot.preview import draw_answers
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import rasterise
from uavseg.regions.sample.place import Disc

SHAPE = (200, 264)
DISC = Disc(1070, 940, 8)
KINDS = np.array([[60, 80, 60], [120, 70, 60], [60, 80, 130]], float)  # meadow, roofs, water


def truth() -> NDArray[np.intp]:
    """Which kind lies where: roofs in a meadow beside water."""
    row, col = np.indices(SHAPE)
    classes = np.where(col > 190, 2, 0)
    for r, c in ((60, 70), (150, 60), (100, 150)):
        classes[(np.abs(row - r) < 22) & (np.abs(col - c) < 26)] = 1
    return classes


def picture(seed: int = 0) -> NDArray[np.uint8]:
    """The three kinds with noise of a deviation of 12."""
    noise = np.random.default_rng(seed).normal(0, 12, (3, *SHAPE))
    return np.rint(np.clip(KINDS[truth()].transpose(2, 0, 1) + noise, 0, 255)).astype(np.uint8)


def write(path: Path, planes: NDArray[Any]) -> Path:
    size = dict(zip(("count", "height", "width"), planes.shape, strict=True)) | {"dtype": planes.dtype.name}
    place = {"crs": "EPSG:32618", "transform": Affine(1, 0, 1000, 0, -1, 1000)}
    with rasterio.open(path, "w", "GTiff", **size, **place) as file:
        file.write(planes)
    return path


@pytest.fixture
def tile(tmp_path: Path) -> Path:
    return write(tmp_path / "tile.tif", picture())


def painted(made: Match) -> NDArray[np.bool_]:
    return rasterise(made.found.rings, Window(0, 0, *SHAPE)) > 0


def overlap(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return float((one & other).sum() / (one | other).sum())


@pytest.mark.slow
@pytest.mark.parametrize("refine", ["pixel", pytest.param("none", marks=pytest.mark.slow)])
def test_one_small_disc_finds_all_of_its_kind(tile: Path, refine: str) -> None:
    made = match(open_raster(str(tile)), MatchRequest(DISC, by="color", refine=refine))
    assert overlap(painted(made), truth() == 1) > (0.97 if refine == "pixel" else 0.8)
    assert made.compared == "color" and made.color is not None and made.color.sample_mean > 0.8
    assert made.warnings == ()


@pytest.mark.slow
def test_a_sample_of_which_a_tenth_is_another_kind_finds_it_too(tile: Path) -> None:
    edge = Disc(1089, 940, 9)  # across the edge of a roof
    row, col = np.indices(SHAPE)
    inside = (row - 60) ** 2 + (col - 89) ** 2 < 81
    assert 0.05 < (truth() != 1)[inside].mean() < 0.15
    assert overlap(painted(match(open_raster(str(tile)), MatchRequest(edge, by="color"))), truth() == 1) > 0.9


@pytest.mark.slow
def test_a_kind_that_is_half_of_the_raster_is_found(tile: Path) -> None:
    made = match(open_raster(str(tile)), MatchRequest(Disc(1020, 980, 10), by="color"))
    assert (truth() == 0).mean() > 0.5
    assert overlap(painted(made), truth() == 0) > 0.97


@pytest.mark.slow
def test_a_kind_that_is_rare_is_found(tmp_path: Path) -> None:
    """One pixel in 170, of a color between those of the others."""
    row, col = np.indices(SHAPE)
    rare = ((row - 40) ** 2 + (col - 150) ** 2 < 81) | ((row - 170) ** 2 + (col - 120) ** 2 < 25)
    planes = np.where(rare, np.array([88, 76, 95]).reshape(3, 1, 1), KINDS[truth()].transpose(2, 0, 1))
    noisy = planes + np.random.default_rng(5).normal(0, 7, planes.shape)
    path = write(tmp_path / "rare.tif", np.rint(np.clip(noisy, 0, 255)).astype(np.uint8))
    made = match(open_raster(str(path)), MatchRequest(Disc(1150, 960, 6), by="color"))
    assert overlap(painted(made), rare) > 0.8


@pytest.mark.slow
def test_tiles_and_threads_change_nothing(tile: Path) -> None:
    source = open_raster(str(tile))
    whole = match(source, MatchRequest(DISC, by="color"))
    other = match(source, MatchRequest(DISC, by="color"), Work(64, threads(2)))
    assert (painted(whole) == painted(other)).all()
    for name, column in whole.found.regions.columns.items():
        np.testing.assert_array_equal(column, other.found.regions.columns[name])


@pytest.mark.slow
def test_turned_by_a_quarter_it_is_the_same_but_at_edges(tmp_path: Path, tile: Path) -> None:
    turned = write(tmp_path / "turned.tif", np.ascontiguousarray(np.rot90(picture(), 2, (1, 2))))
    back = Disc(2000 + SHAPE[1] - DISC.x, 2000 - SHAPE[0] - DISC.y, DISC.radius)
    one, other = (
        painted(match(open_raster(str(path)), MatchRequest(where, by="color")))
        for path, where in ((tile, DISC), (turned, back))
    )
    assert overlap(one, other[::-1, ::-1]) > 0.96


def in_the_light(path: Path, least: float) -> tuple[Path, NDArray[np.bool_], Disc]:
    """Patches of four kinds in light that grows from `least` to 1.6 along the rows; and the first kind."""
    field = ndimage.gaussian_filter(np.random.default_rng(3).normal(size=(4, *SHAPE)), (0, 7, 7))
    kind = (field / field.std((1, 2), keepdims=True)).argmax(0)
    colors = np.array([[70, 90, 60], [110, 80, 60], [60, 80, 110], [100, 110, 100]], float)
    light = np.linspace(least, 1.6, SHAPE[1])
    noise = np.random.default_rng(4).normal(0, 3, (3, *SHAPE))
    planes = np.rint(np.clip(colors[kind].transpose(2, 0, 1) * light + noise, 0, 255)).astype(np.uint8)
    room = ndimage.distance_transform_edt(np.pad(kind == 0, 1))[1:-1, 1:-1]
    row, col = np.unravel_index(room.argmax(), SHAPE)
    return write(path, planes), kind == 0, Disc(1000.5 + col, 999.5 - row, 6)


FLAT = ReadOptions(flatten="90px")


@pytest.mark.slow
def test_without_slow_light_a_kind_is_found_from_end_to_end(tmp_path: Path) -> None:
    path, wanted, disc = in_the_light(tmp_path / "light.tif", 0.4)
    dark, flat = (
        painted(match(open_raster(str(path), read), MatchRequest(disc, by="color")))
        for read in (ReadOptions(), FLAT)
    )
    assert overlap(flat, wanted) > 0.85 > 0.75 > overlap(dark, wanted)


@pytest.mark.slow
def test_what_is_found_without_slow_light_hardly_depends_on_it(tmp_path: Path) -> None:
    found = []
    for number, least in enumerate((0.5, 1.6)):
        path, _, disc = in_the_light(tmp_path / f"{number}.tif", least)
        found.append(painted(match(open_raster(str(path), FLAT), MatchRequest(disc, by="color"))))
    assert overlap(*found) > 0.85


@pytest.mark.slow
def test_tiles_change_nothing_without_slow_light(tmp_path: Path) -> None:
    path, _, disc = in_the_light(tmp_path / "light.tif", 0.4)
    source, request = open_raster(str(path), FLAT), MatchRequest(disc)
    whole, parts = (match(source, request, work).found for work in (Work(), Work(64, threads(2))))
    assert np.array_equal(whole.rings.vertices, parts.rings.vertices)
    assert whole.regions.metadata["flatten"] == "90px"


def test_slow_light_of_many_bands_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "many.tif", np.tile(picture(), (2, 1, 1)))
    with pytest.raises(ParameterError, match="slow light is taken away from 4 bands at most; choose some"):
        match(open_all_bands([str(path)], FLAT), MatchRequest(DISC))


@pytest.mark.slow
def test_attributes_are_of_the_intensity_and_the_similarity_of_the_colors(tile: Path) -> None:
    made = match(open_raster(str(tile)), MatchRequest(DISC, by="color"))
    luminance = np.tensordot([0.2126, 0.7152, 0.0722], picture().astype(float), 1) / 255
    labels = rasterise(made.found.rings, Window(0, 0, *SHAPE))
    columns = made.found.regions.columns
    means = ndimage.mean(luminance, labels, columns["id"])
    np.testing.assert_allclose(columns["mean"], means, atol=0.005)
    assert ((columns["similarity"] > 0.5) & (columns["similarity"] <= 1)).all()


@pytest.mark.slow
def test_nodata_is_in_no_region(tmp_path: Path) -> None:
    planes = picture().astype(np.float32)
    planes[:, 50:70, 40:60] = np.nan
    made = match(
        open_raster(str(write(tmp_path / "holes.tif", planes))), MatchRequest(Disc(1080, 940, 8), by="color")
    )
    assert not painted(made)[50:70, 40:60].any()
    assert overlap(painted(made), (truth() == 1) & ~np.isnan(planes[0])) > 0.95


@pytest.mark.slow
def test_five_bands_are_compared_together(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    more = rng.normal(90, 12, (2, *SHAPE)) + 30 * (truth() == 1)
    planes = np.concatenate([picture(), np.clip(more, 0, 255).astype(np.uint8)])
    source = open_raster(str(write(tmp_path / "five.tif", planes)), ReadOptions(band=1))
    made = match(source, MatchRequest(DISC, by="color", bands=(1, 2, 3, 4, 5)))
    assert overlap(painted(made), truth() == 1) > 0.97


def test_texture_is_compared_where_one_of_its_options_is_given(tile: Path) -> None:
    large = Disc(1070, 940, 20)
    assert match(open_raster(str(tile)), MatchRequest(large, window=16)).compared == "texture"
    with pytest.raises(ParameterError, match="are of texture"):
        MatchRequest(large, window=16, by="color")
    with pytest.raises(ParameterError, match="by auto, color or texture"):
        replace(MatchRequest(large), by="shape")


@pytest.mark.slow
def test_where_color_says_little_a_warning_says_so(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).normal(100, 12, (1, *SHAPE)).astype(np.uint8)
    path = write(tmp_path / "noise.tif", noise)
    with pytest.warns(UserWarning, match="color hardly parts the sample"):
        uavseg.match(path, (1070, 940, 8), by="color")


@pytest.mark.slow
def test_where_no_region_is_sure_enough_it_says_so(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (3, *SHAPE)).astype(np.uint8)
    request = MatchRequest(DISC, by="color", min_confidence=1)
    made = match(open_raster(str(write(tmp_path / "noise.tif", noise))), request)
    assert len(made.found.regions) == 0
    assert any("a confidence of less than 1;" in text for text in made.warnings)


@pytest.mark.slow
def test_a_sample_of_few_pixels_is_refused(tile: Path) -> None:
    with pytest.raises(SampleError, match="32 valid pixels; expected at least 64"):
        match(open_raster(str(tile)), MatchRequest(Disc(1070, 940, 3), by="color"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("pond0", 0.8),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in [("pond2", 0.7), ("pond3", 0.7), ("cloud", 0.5)]
        ),
    ],
)
def test_real_pictures(shared_data: Path, name: str, least: float) -> None:
    """Melt ponds and a cloud by one disc of a radius of 8 pixels at the most inner pixel of the truth."""
    folder = shared_data / "labelled"
    with rasterio.open(folder / f"{name}_truth.tif") as file:
        wanted = file.read(1) == 1
    depths = ndimage.distance_transform_edt(np.pad(wanted, 1))[1:-1, 1:-1]
    row, col = np.unravel_index(np.argmax(depths), depths.shape)
    source = open_raster(str(folder / f"{name}.tif"))
    x, y = source.geobox.transform * (float(col) + 0.5, float(row) + 0.5)
    made = match(source, MatchRequest(Disc(x, y, 8 * abs(source.geobox.transform.a)), by="color"))
    box = made.found.geobox
    assert overlap(rasterise(made.found.rings, Window(0, 0, *box.shape)) > 0, wanted) > least


ROOFS = ((30, 60), (110, 60), (110, 200))


def roofs_on_a_slope() -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Roofs on ground whose colours change without a step, theirs among them; and where the roofs are."""
    row, col = np.indices(SHAPE)
    rng = np.random.default_rng(2)
    slow = ndimage.gaussian_filter(rng.normal(0, 1, (3, *SHAPE)), (0, 12, 12))
    ground = 120 + 45 * slow / slow.std((1, 2), keepdims=True)
    ground[1:] = 0.6 * ground[:1] + 0.4 * ground[1:]
    roofs = np.any([(abs(row - r) < 14) & (abs(col - c) < 18) for r, c in ROOFS], axis=0)
    colors = np.where(roofs, np.array([170, 160, 140])[:, None, None], ground)
    return np.rint(np.clip(colors + rng.normal(0, 5, (3, *SHAPE)), 0, 255)).astype(np.uint8), roofs


@pytest.fixture
def slope(tmp_path: Path) -> Path:
    return write(tmp_path / "slope.tif", roofs_on_a_slope()[0])


def answered(path: Path, answer: int, **words: Any) -> Match:
    x, y = 1000 + ROOFS[0][1], 1000 - ROOFS[0][0]
    return match(open_raster(str(path)), MatchRequest(Disc(x, y, 8), answer=answer, **words))


@pytest.mark.slow
def test_what_touches_the_sample_are_the_finer_regions_with_its_pixels(slope: Path) -> None:
    finer, touching = answered(slope, 3), answered(slope, 2)
    regions, _ = ndimage.label(painted(finer))
    own = regions[ROOFS[0]]
    assert own > 0 and np.array_equal(painted(touching), regions == own)
    assert len(touching.found.regions) == 1 < len(finer.found.regions)


@pytest.mark.slow
def test_answers_that_differ_are_named_the_same_whichever_is_asked_for(slope: Path) -> None:
    made = [answered(slope, n) for n in (1, 2, 3)]
    assert [one.answers for one in made] == [(1, 2, 3)] * 3 and len({one.others for one in made}) == 1
    roofs = roofs_on_a_slope()[1]
    assert overlap(painted(made[2]), roofs) > 2 * overlap(painted(made[0]), roofs)
    table = made[0].color
    assert table is not None and table.finer_share == pytest.approx(painted(made[2]).mean(), abs=0.05)
    assert table.share == pytest.approx(painted(made[0]).mean(), abs=0.05)


@pytest.mark.slow
def test_finer_kinds_that_find_the_same_are_no_answer(tile: Path) -> None:
    made = match(open_raster(str(tile)), MatchRequest(DISC, by="color"))
    assert made.answers == (1, 2) and made.found.regions.metadata["answers"] == [
        "the whole kind",
        "what touches the sample",
    ]
    touching = match(open_raster(str(tile)), MatchRequest(DISC, by="color", answer=2))
    assert np.array_equal(painted(touching), painted(made) & (ndimage.label(painted(made))[0] == 1))
    with pytest.raises(ParameterError, match="no answer 3, because finer kinds find no less"):
        match(open_raster(str(tile)), MatchRequest(DISC, by="color", answer=3))


@pytest.mark.slow
def test_tiles_change_no_answer(slope: Path) -> None:
    source, request = open_raster(str(slope)), MatchRequest(Disc(1060, 970, 8), answer=2, by="color")
    whole, parts = (match(source, request, Work(tile=side)).found for side in (None, 64))
    assert whole.regions.columns.keys() == parts.regions.columns.keys()
    assert np.array_equal(whole.rings.vertices, parts.rings.vertices)


@pytest.mark.parametrize("words", [{"answer": 0}, {"answer": 4}, {"answer": 2, "by": "texture"}])
def test_answers_that_are_none_are_refused(words: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=r"an answer is 1, 2 or 3|texture has one answer"):
        MatchRequest(DISC, **words)


def with_picture(path: Path, folder: Path, *words: str) -> Result:
    line = ["match", str(path), "-q", "--by", "color", "-o", str(folder / "a.gpkg"), *words]
    return CliRunner().invoke(main, line)


def panel(path: Path, number: int, count: int) -> NDArray[np.int64]:
    """The map of one answer in a picture of several, all as wide."""
    with Image.open(path) as drawn:
        pixels = np.asarray(drawn.convert("RGB")).astype(np.int64)
    step = (pixels.shape[1] - 24) // count  # a margin of 0.15 inches is on both sides of each map
    return pixels[:, (number - 1) * step :][:, :step]


@pytest.mark.slow
def test_each_answer_is_drawn_as_it_is_alone(slope: Path, tmp_path: Path) -> None:
    """Regions are the same bytes with the picture, whose parts are pictures of the answers one by one."""
    sample = ("--like", f"{1000 + ROOFS[0][1]},{1000 - ROOFS[0][0]},8")
    picture = str(tmp_path / "a.png")
    assert with_picture(slope, tmp_path, *sample, "--png", picture).exit_code == 0
    drawn = [panel(tmp_path / "a.png", number, 3) for number in (1, 2, 3)]
    source = open_raster(str(slope))
    for number, part in enumerate(drawn, start=1):
        found = answered(slope, number, by="color").found.regions
        name = f"--answer {number}: {ANSWERS[number]}"
        draw_answers(source.dataset, tmp_path / "one.png", {name: found}, overwrite=True)
        alone = panel(tmp_path / "one.png", 1, 1)
        assert np.abs(alone - part).mean() < 0.5
        assert all(np.abs(alone - other).mean() > 1 for other in drawn if other is not part)
    with_it = (tmp_path / "a.gpkg").read_bytes()
    assert with_picture(slope, tmp_path, *sample, "--overwrite").exit_code == 0
    assert (tmp_path / "a.gpkg").read_bytes() == with_it


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--each", "--png", "a.png"], "--png is for one source"),
        (["--png", "a.jpg"], "a preview is a PNG picture"),
        (["--png", "is.png"], "is.png exists"),
        (["--ask", "--png", "a.place.png"], "two outputs have the same name"),
        (["--classes", "s.gpkg", "--png", "a.png"], "leave out --like, --png"),
    ],
)
def test_pictures_of_answers_that_are_refused_before_the_work(
    tile: Path, tmp_path: Path, words: list[str], text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "is.png").write_bytes(b"mine")
    before = set(tmp_path.iterdir())
    said = with_picture(tile, tmp_path, "--like", f"{DISC.word}", *words)
    assert said.exit_code in (1, 2) and text in said.stderr
    assert set(tmp_path.iterdir()) == before and (tmp_path / "is.png").read_bytes() == b"mine"
