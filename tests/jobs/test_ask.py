"""Questions about places whose answers help most: regions are those of the same samples without questions."""

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from hypothesis import given, settings, strategies as st
from PIL import Image

import uavseg
from tests.jobs.test_match_by_color import DISC, SHAPE, overlap, painted, picture, truth, write
from tests.jobs.test_next_sample import LEFT, fields, mask_of, with_holes
from uavseg.cli import main
from uavseg.errors import ParameterError
from uavseg.execution.executors import threads
from uavseg.jobs.match.match import match, with_answers
from uavseg.jobs.match.ranges_of_sample import color_sources
from uavseg.jobs.match.request import Ask, MatchRequest
from uavseg.jobs.source.open_source import open_raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.plot.preview import PlacePicture
from uavseg.raster.grid.tiling import spread_windows
from uavseg.regions.sample import similarity
from uavseg.regions.sample.place import Disc, sample_mask

LINE = ["--like", "1044,900,10", "--by", "color"]
MOST = 40  # questions: far more than are worth asking


@pytest.fixture
def tile(tmp_path: Path) -> Path:
    return write(tmp_path / "fields.tif", fields())


class Answers:
    """Answers to questions, by a rule; ends them after `count`."""

    def __init__(self, rule: Callable[[Disc], Any], count: int = MOST) -> None:
        self.rule, self.count = rule, count
        self.asked: list[Disc] = []

    def __call__(self, disc: Disc) -> Any:
        if len(self.asked) == self.count:
            return None
        self.asked.append(disc)
        return self.rule(disc)


def request_of(path: Path, ask: Ask, first: Disc = LEFT, work: Work = SERIAL) -> MatchRequest:
    return with_answers(open_raster(str(path)), MatchRequest(first, by="color"), ask, work)


def is_left_of(col: float) -> Callable[[Disc], bool]:
    return lambda disc: disc.x < 1000 + col


@pytest.mark.slow
@pytest.mark.parametrize("border", [88, pytest.param(176, marks=pytest.mark.slow)])
def test_true_answers_find_what_is_meant_and_end(tile: Path, border: int) -> None:
    """Whether the second field is of the kind of the first is open: the answers say it."""
    ask = Answers(is_left_of(border))
    request = request_of(tile, ask)
    assert 1 <= len(ask.asked) < 10 and any(88 < disc.x - 1000 < 176 for disc in ask.asked)
    made = match(open_raster(str(tile)), request)
    assert overlap(painted(made), np.indices(SHAPE)[1] < border) > 0.9


@pytest.mark.slow
def test_kinds_that_are_sure_are_soon_asked_about(tmp_path: Path) -> None:
    """Three kinds, far from each other: few questions, and the answers change nothing."""
    path = write(tmp_path / "tile.tif", picture())
    ask = Answers(lambda disc: bool(truth()[int(1000 - disc.y), int(disc.x - 1000)] == 1))
    request = request_of(path, ask, DISC)
    assert len(ask.asked) <= 5
    assert overlap(painted(match(open_raster(str(path)), request)), truth() == 1) > 0.95


@pytest.mark.slow
def test_answers_become_samples_in_their_order(tile: Path) -> None:
    ask = Answers(is_left_of(88), 2)
    request = request_of(tile, ask)
    wanted = tuple(disc for disc in ask.asked if disc.x < 1088)
    assert request.samples == (LEFT, *wanted)
    assert request.unlike == tuple(disc for disc in ask.asked if disc not in wanted)
    assert request_of(tile, lambda disc: None) == MatchRequest((LEFT,), by="color")


@pytest.mark.slow
def test_what_is_skipped_is_no_sample_and_not_asked_about_again(tile: Path) -> None:
    ask = Answers(lambda disc: "skip")
    assert request_of(tile, ask) == MatchRequest((LEFT,), by="color")
    assert 1 <= len(set(ask.asked)) == len(ask.asked) < MOST


@pytest.mark.slow
def test_tiles_and_threads_change_no_question(tile: Path) -> None:
    one, other = Answers(is_left_of(88), 3), Answers(is_left_of(88), 3)
    assert request_of(tile, one) == request_of(tile, other, work=Work(64, threads(2)))
    assert one.asked == other.asked


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=5)
def test_places_lie_on_valid_pixels_apart_from_each_other(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    path, planes = with_holes(tmp_path_factory.mktemp("holes"), rng, seed)
    ask = Answers(lambda disc: [True, False, "skip"][rng.integers(3)], 4)
    request_of(path, ask)
    taken = mask_of(path, LEFT)
    for disc in ask.asked:
        inside = mask_of(path, disc)
        assert inside.sum() >= 64 and (planes[0][inside] != 0).mean() > 0.85
        assert not (inside & taken).any()
        taken |= inside


@pytest.mark.slow
def test_the_place_is_that_of_the_largest_expected_change(tile: Path) -> None:
    """Against plain loops: windows that are probably wrong, by how near they are to a place and samples."""
    asked = Answers(lambda disc: None, 1)
    request_of(tile, asked)
    raster = open_raster(str(tile))
    tile_pass = SERIAL.over(raster)
    bands = color_sources(raster, raster.grey(tile_pass), (), tile_pass)
    colors = similarity.window_colors(bands, tile_pass)
    sample = sample_mask(LEFT, raster.geobox)
    table = similarity.sample_colors(bands, [sample], tile_pass).table()
    every = np.concatenate(colors).astype(float)

    def nearness(one: float, other: float) -> float:
        return float(np.exp(-(((one - other) / every.std() / 0.5) ** 2) / 2))

    own = similarity._sample_colors(bands, sample).mean()
    chance = [table.of(one).mean() / 65535 for one in colors]
    pure = [1 / (1 + one.std() / every.std() / 0.5) for one in colors]
    wrong = [
        max(min(p, 1 - p), 0.1) * (1 - nearness(one.mean(), own)) * clean
        for p, one, clean in zip(chance, colors, pure, strict=True)
    ]
    changes = [
        sum(nearness(one.mean(), other.mean()) * w for other, w in zip(colors, wrong, strict=True))
        for one in colors
    ]
    scores = [change * clean for change, clean in zip(changes, pure, strict=True)]
    places = [
        (1000 + window.col + window.cols / 2, 1000 - window.row - window.rows / 2)
        for window in spread_windows(raster.geobox.shape, similarity._WINDOWS, similarity._WINDOW)
    ]
    (disc,) = asked.asked
    distances = [np.hypot(disc.x - x, disc.y - y) for x, y in places]
    chosen = int(np.argmin(distances))
    assert distances[chosen] < 8
    free = [
        n
        for n, (x, y) in enumerate(places)
        if min(x - 1000, 1000 + SHAPE[1] - x, 1000 - y, y - 1000 + SHAPE[0]) > 20
        and np.hypot(x - LEFT.x, y - LEFT.y) > 30
    ]
    assert chosen in free
    assert scores[chosen] == pytest.approx(max(scores[n] for n in free), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "text"),
    [
        ({"ask": lambda disc: "maybe"}, "an answer is True, False, \"skip\" or None, not 'maybe'"),
        ({"ask": lambda disc: 1}, "an answer is True, False"),
        ({"ask": lambda disc: np.zeros(2)}, "an answer is True, False"),
        ({"ask": lambda disc: True, "by": "texture"}, "answers are compared by color"),
        ({"ask": lambda disc: True, "by": "auto", "window": 16}, "answers are compared by color"),
        ({"ask": 3}, "ask is a function or None, not 3"),
    ],
)
def test_what_cannot_be_asked_is_refused(tile: Path, words: dict[str, Any], text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        uavseg.match(tile, (1044, 900, 10), **({"by": "color"} | words))
    assert text in str(caught.value)


def test_one_source_and_no_classes_are_asked_about(tile: Path, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="leave out like, unlike, ask"):
        uavseg.match(tile, classes="samples.gpkg", ask=lambda disc: True)
    with pytest.raises(ParameterError, match="ask is for one source"):
        uavseg.each(
            uavseg.match, tile, str(tmp_path / "{stem}.gpkg"), like=(1044, 900, 10), ask=lambda disc: True
        )


def run(path: Path, target: Path, answers: str, *more: str) -> Result:
    line = ["match", str(path), *LINE, "--ask", "-o", str(target), *more]
    return CliRunner().invoke(main, line, input=answers)


@pytest.mark.slow
def test_the_line_at_the_end_gives_the_same_bytes(tile: Path, tmp_path: Path) -> None:
    target = tmp_path / "a.geojson"
    said = run(tile, target, "what\nNo\nyes\nq\n")
    assert said.exit_code == 0, said.output
    assert said.stderr.count("an answer is y, n, s or q, not 'what'") == 1
    asked = said.stderr.splitlines()
    line = next(one for one in asked if one.startswith("no more questions; ")).partition(": ")[2]
    content = target.read_bytes()
    words = shlex.split(line)
    assert words[:2] == ["uavseg", "match"] and "--ask" not in words
    assert sum(word.startswith("--like=") for word in words) == 1
    again = CliRunner().invoke(main, [*words[1:], "--overwrite"])
    assert again.exit_code == 0, again.output
    assert target.read_bytes() == content
    answers = iter([False, True, None])
    frame = uavseg.match(tile, (1044, 900, 10), by="color", ask=lambda disc: next(answers))
    facts = frame.attrs["uavseg"]
    assert [f"--unlike={x:.15g},{y:.15g},{r:.15g}" for x, y, r in facts.get("unlike", [])] == [
        word for word in words if word.startswith("--unlike=")
    ]
    assert len(facts["like"]) == 2


@pytest.mark.slow
def test_each_question_says_where_and_draws_it(tile: Path, tmp_path: Path) -> None:
    target = tmp_path / "a.gpkg"
    said = run(tile, target, "")
    assert said.exit_code == 0 and "standard input has ended" in said.stderr and target.exists()
    asked = Answers(lambda disc: None, 1)
    request_of(tile, asked)
    (disc,) = asked.asked
    lon, lat = open_raster(str(tile)).geobox.lonlat_from_xy(disc.x, disc.y)
    where = f"what lies at {disc.x:.15g}, {disc.y:.15g} (latitude {lat:.7f}, longitude {lon:.7f})?"
    assert where in said.stderr and str(tmp_path / "a.place.png") in said.stderr
    with Image.open(tmp_path / "a.place.png") as drawn:
        pixels = np.asarray(drawn.convert("RGB")).astype(int)
    rows, cols = np.nonzero((pixels == 255).all(2))  # the outline, around the middle of the disc
    assert abs(np.ptp(rows) - np.ptp(cols)) < 6 and len(rows) > 50
    again = run(tile, tmp_path / "b.gpkg", "q\n")
    assert again.exit_code == 0 and "standard input has ended" not in again.stderr


def test_the_picture_is_in_the_colours_of_the_raster(tmp_path: Path) -> None:
    path = write(tmp_path / "tile.tif", picture())
    drawn_in = PlacePicture(tmp_path / "p.png")
    drawn_in.draw(open_raster(str(path)).dataset, Disc(1220, 900, 10), "dtype")
    with Image.open(tmp_path / "p.png") as drawn:
        pixels = np.asarray(drawn.convert("RGB")).astype(float)
    middle = pixels[pixels.shape[0] // 2 - 9 :][:18, pixels.shape[1] // 2 :][:, :18]
    assert middle.mean((0, 1)) == pytest.approx((60, 80, 130), abs=12)


@pytest.mark.parametrize("name", ["a.place.png", "a.gpkg"])
def test_nothing_is_overwritten(tile: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"mine")
    said = run(tile, tmp_path / "a.gpkg", "y\n")
    assert said.exit_code == 1 and name in said.stderr and "--overwrite" in said.stderr
    assert [one.name for one in tmp_path.iterdir() if one != tile] == [name]
    assert (tmp_path / name).read_bytes() == b"mine"


@pytest.mark.slow
def test_a_raster_without_a_place_on_the_globe_has_no_latitude(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "plain.tif"
    Image.fromarray(fields()[0]).save(path)
    line = ["match", str(path), "--like", "44,100,10", "--by", "color", "--ask", "-o", "-"]
    said = CliRunner().invoke(main, line, input="q\n")
    assert said.exit_code == 0, said.output
    assert (tmp_path / "match.place.png").exists()
    assert said.stdout.startswith("{") and "latitude" not in said.stderr and "what lies at" in said.stderr


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--each"], "--ask is for one source"),
        (["--window", "16"], "window, similarity and intensity are of texture"),
    ],
)
def test_options_that_do_not_go_with_questions(
    tile: Path, tmp_path: Path, words: list[str], text: str
) -> None:
    said = run(tile, tmp_path / "a.gpkg", "y\n", *words)
    assert said.exit_code in (1, 2) and text in said.stderr and not (tmp_path / "a.gpkg").exists()


def test_classes_are_not_asked_about(tile: Path) -> None:
    said = CliRunner().invoke(main, ["match", str(tile), "--classes", "c.gpkg", "--ask"])
    assert said.exit_code == 2 and "leave out --ask" in said.stderr
