"""The benchmark of quality: scenes are what they say, marks keep their laws, everybody answers."""

import doctest
from dataclasses import replace
from itertools import product
from math import log2
from pathlib import Path

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis.extra.numpy import array_shapes, arrays
from hypothesis.strategies import SearchStrategy
from scipy import ndimage

from benchmarks import __main__ as command
from benchmarks.quality import metrics, peers, pictures, planes, section, shapes, summary, textures
from benchmarks.quality.camera import Camera
from benchmarks.quality.methods import Method, methods
from benchmarks.quality.metrics import Marks, boundary, boundary_f, iou, marks
from benchmarks.quality.run import Score, scores
from benchmarks.quality.scenes import BRIGHT, DARK, FAMILIES, RANGE, Cover, Scene, draw
from benchmarks.quality.summary import Summary
from benchmarks.quality.tables import tables
from uavseg.errors import ParameterError

SIDE = 160
SHAPES = [getattr(shapes, name) for name in ("blobs", "roads", "islands", "terraces", "holes", "parcels")]
SHAPES += [shapes.coast, shapes.country]
TEXTURES = [textures.smooth, textures.sand, textures.forest, textures.rows, textures.glint]


def dice(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def masks() -> SearchStrategy[np.ndarray]:
    return arrays(bool, array_shapes(min_dims=2, max_dims=2, min_side=3, max_side=12))


@pytest.mark.parametrize("name", FAMILIES)
def test_a_scene_is_the_same_every_time_and_another_for_another_seed(name: str) -> None:
    first, again, other = (draw(FAMILIES[name], seed, SIDE) for seed in (0, 0, 1))
    assert np.array_equal(first.values, again.values)
    assert np.array_equal(first.truth, again.truth) and np.array_equal(first.valid, again.valid)
    assert not np.array_equal(first.values, other.values)


@pytest.mark.parametrize("shape", SHAPES)
def test_without_texture_and_noise_the_truth_is_what_is_in_range(shape: shapes.Shape) -> None:
    plain = Cover(textures.smooth, 0)
    scene = draw(replace(FAMILIES["sand"], shape=shape, things=plain, ground=plain, camera=Camera()), 3, SIDE)
    assert np.array_equal((scene.v >= RANGE[0]) & (scene.v <= RANGE[1]), scene.truth)
    assert 0.03 < scene.truth.mean() < 0.8
    found = marks(scene.truth, scene.truth, scene.valid)
    assert replace(found, vi=0) == Marks(1, 1, 0, 1, 0) and found.vi == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("name", FAMILIES)
def test_things_and_ground_have_their_tones_on_average(name: str) -> None:
    family = replace(FAMILIES[name], camera=Camera())
    scene = draw(family, 0, SIDE)
    for mask, tone in ((scene.truth, family.tones[0]), (~scene.truth, family.tones[1])):
        assert scene.v[mask].mean() == pytest.approx(tone, abs=0.004)


def test_where_means_are_equal_so_is_what_a_threshold_finds() -> None:
    for family in FAMILIES.values():
        if family.by_texture:
            scene = draw(family, 0, 2 * SIDE)
            inside, outside = (float((scene.v[mask] > 0.55).mean()) for mask in (scene.truth, ~scene.truth))
            assert inside == pytest.approx(outside, abs=0.08)


@pytest.mark.parametrize("texture", TEXTURES)
def test_a_texture_has_mean_0_and_deviation_1(texture: textures.Texture) -> None:
    plane = texture(SIDE, dice())
    assert plane.shape == (SIDE, SIDE)
    assert plane.mean() == pytest.approx(0, abs=1e-9) and plane.std() == pytest.approx(1)


def test_roads_are_as_wide_as_they_say() -> None:
    for width in range(3, 13):
        inside = shapes.road(400, width, dice(width))
        deep = ndimage.distance_transform_edt(inside)[30:-30, 30:-30]  # what leaves the picture has one side
        assert deep.max() == pytest.approx(width / 2, abs=0.9)
        assert ndimage.label(inside, np.ones((3, 3)))[1] == 1


def test_islands_do_not_touch() -> None:
    inside = shapes.islands(280, dice())
    assert ndimage.label(inside)[1] == 100
    assert ndimage.label(inside, np.ones((3, 3)))[1] == 100


def test_noise_is_as_strong_as_it_says() -> None:
    for noise in (0.05, 0.1):
        flat = replace(FAMILIES["blobs, no noise"], things=Cover(strength=0), ground=Cover(strength=0))
        scene = draw(replace(flat, camera=Camera(noise)), 0, SIDE)
        for mask, tone in ((scene.truth, BRIGHT), (~scene.truth, DARK)):
            assert (scene.v[mask] - tone).std() == pytest.approx(noise, rel=0.05)
            assert peers.noise_of(scene.v) == pytest.approx(noise, rel=0.1)


def test_the_camera_does_what_it_is_told() -> None:
    family = FAMILIES["blobs, no noise"]

    def seen(camera: Camera) -> Scene:
        return draw(replace(family, camera=camera), 0, SIDE)

    plain = seen(Camera())
    assert plain.values.dtype == np.uint8 and plain.valid.all()
    deep = seen(Camera(white=4095))
    assert deep.values.dtype == np.uint16 and np.abs(deep.v - plain.v).max() <= 0.51 / 255 + 0.51 / 4095
    collar = seen(Camera(collar=True))
    assert 0.3 < collar.valid.mean() < 0.9 and not (collar.truth & ~collar.valid).any()
    assert np.isnan(collar.v[~collar.valid]).all() and (collar.values[~collar.valid] == 0).all()
    squeezed = seen(Camera(jpeg=15))
    assert np.abs(squeezed.v - plain.v).max() > 0 and np.abs(squeezed.v - plain.v).mean() < 0.03
    coarse = seen(Camera(coarse=3))
    changed = coarse.values != plain.values
    assert not changed[:, : SIDE // 2].any() and changed[:, SIDE // 2 :].any()
    lit = seen(Camera(light=(0.5, 0.6)))
    assert (lit.v < plain.v).all()


@given(masks())
@settings(max_examples=50, deadline=None)
def test_a_mask_is_nearest_to_itself(mask: np.ndarray) -> None:
    every = np.ones_like(mask)
    found = marks(mask, mask, every)
    assert (found.iou, found.boundary_f, found.vi, found.area_error) == (1, 1, pytest.approx(0, abs=1e-9), 0)
    assert found.pieces == (1 if mask.any() else 0)


@given(masks())
@settings(max_examples=50, deadline=None)
def test_marks_are_those_of_a_slow_plain_version(mask: np.ndarray) -> None:
    other, every = np.roll(mask, 1, axis=1), np.ones_like(mask)
    other[0] = False
    found, swapped = marks(other, mask, every), marks(mask, other, every)
    assert found.iou == swapped.iou == pytest.approx(slow_iou(other, mask))
    assert found.boundary_f == pytest.approx(swapped.boundary_f)
    assert found.boundary_f == pytest.approx(slow_f(other, mask))
    assert found.vi == pytest.approx(swapped.vi)
    assert found.vi == pytest.approx(slow_vi(pieces(other), pieces(mask)))


def slow_iou(one: np.ndarray, other: np.ndarray) -> float:
    pairs = list(zip(one.flat, other.flat, strict=True))
    either = sum(a or b for a, b in pairs)
    return sum(a and b for a, b in pairs) / either if either else 1.0


def slow_f(one: np.ndarray, other: np.ndarray) -> float:
    edges = [slow_edge(mask) for mask in (one, other)]
    if not all(edges):
        return float(not any(edges))
    near = [
        np.mean([any((r - a) ** 2 + (c - b) ** 2 <= 4 for a, b in theirs) for r, c in mine])
        for mine, theirs in (edges, edges[::-1])
    ]
    return float(2 * near[0] * near[1] / sum(near)) if any(near) else 0.0


def slow_edge(mask: np.ndarray) -> list[tuple[int, int]]:
    inside = set(zip(*np.nonzero(mask), strict=True))
    outside = set(zip(*np.nonzero(~mask), strict=True))
    beside = ((-1, 0), (1, 0), (0, -1), (0, 1))
    return [(r, c) for r, c in inside if any((r + a, c + b) in outside for a, b in beside)]


def pieces(mask: np.ndarray) -> np.ndarray:
    names, count = np.zeros(mask.shape, int), 0
    for seed in zip(*np.nonzero(mask), strict=True):
        if names[seed]:
            continue
        count += 1
        open_ends = [seed]
        while open_ends:
            r, c = open_ends.pop()
            if 0 <= r < len(mask) and 0 <= c < mask.shape[1] and mask[r, c] and not names[r, c]:
                names[r, c] = count
                open_ends += [(r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)]
    return names


def slow_vi(one: np.ndarray, other: np.ndarray) -> float:
    total = 0.0
    for a, b in product(np.unique(one), np.unique(other)):
        both = float(((one == a) & (other == b)).mean())
        if both:
            total -= both * (log2(both / (one == a).mean()) + log2(both / (other == b).mean()))
    return total


def test_what_is_not_valid_counts_nowhere() -> None:
    truth = np.zeros((20, 20), bool)
    truth[5:15, 5:15] = True
    valid = np.ones_like(truth)
    valid[:, 12:] = False
    found = truth ^ ~valid
    assert marks(found, truth, valid) == marks(truth, truth, valid) == Marks(1, 1, 0, 1, 0)
    assert not boundary(truth & valid, valid)[6:14, 11].any()  # the end of what is known is no boundary


def test_regions_in_pieces_are_counted() -> None:
    truth = np.ones((8, 8), bool)
    truth[0] = False
    found = truth.copy()
    found[:, [2, 5]] = False
    assert marks(found, truth, np.ones_like(truth)).pieces == 3
    assert marks(found, truth, np.ones_like(truth)).area_error == pytest.approx(2 / 8)
    assert iou(found, truth) == pytest.approx(6 / 8) and boundary_f(found, truth, found | ~found) < 1


@pytest.fixture(scope="module")
def easy() -> Scene:
    return draw(FAMILIES["collar"], 0, SIDE)


@pytest.mark.filterwarnings("ignore:The probability range is outside")  # of the random walker, by rounding
@pytest.mark.parametrize("method", methods(), ids=lambda method: f"{method.who}: {method.setting}")
def test_everybody_answers(method: Method, easy: Scene) -> None:
    scene = easy if method.middle is None else easy.middle(128)
    found = method.find(scene)
    assert found.shape == scene.truth.shape and found.dtype == bool
    assert not (found & ~scene.valid).any()
    if method.default and method.who in ("uavseg", "total variation", "blur and threshold"):
        assert iou(found, scene.truth) > 0.5


@pytest.mark.parametrize("method", methods(), ids=lambda method: f"{method.who}: {method.setting}")
def test_nobody_fails_where_there_is_nothing(method: Method) -> None:
    dark = Cover(strength=0)
    family = replace(FAMILIES["sand"], things=dark, ground=dark, camera=Camera(), tones=(0.3, 0.3))
    found = method.find(draw(family, 0, 64))
    assert found.shape == (64, 64)


def test_everybody_has_one_default_and_names_are_not_used_twice() -> None:
    known = methods(["smooth"])
    for who in {method.who for method in known}:
        assert sum(method.default for method in known if method.who == who) == 1
    assert len({method.key for method in methods()}) == len(methods())
    with pytest.raises(ParameterError, match="refinement"):
        methods(["magic"])


def test_scores_are_remembered_and_do_not_depend_on_processes() -> None:
    few = [
        method
        for method in methods()
        if method.key in {("blur and threshold", "sigma 2"), ("Otsu", "sigma 2")}
    ]
    told: list[str] = []
    first = scores(few, 1, ["sand", "rows"], tell=told.append)
    again = scores(few, 1, ["sand", "rows"], processes=1, tell=told.append)
    assert len(told) == 2 and again == first
    assert [(score.family, score.method) for score in first] == list(product(["sand", "rows"], few))


def made_up(family: str, who: str, setting: str, iou: float, **more: object) -> Score:
    method = Method(who, setting, peers.blurred, "ours" if who == "uavseg" else "peer", **more)  # type: ignore[arg-type]
    return Score(family, 0, method, Marks(iou, iou, 0.5, 1, 0.1), 0.1)


def test_the_tables_say_who_is_best_where() -> None:
    families = {"sand": (0.9, 0.8, 0.7, 0.95), "rows": (0.9, 0.8, 0.99, 0.6)}
    found = []
    for family, (us, other, plain, tuned) in families.items():
        found += [
            made_up(family, "uavseg", "default", us, default=True),
            made_up(family, "uavseg", "paper", other),
            made_up(family, "blur", "1", plain, default=True),
            made_up(family, "blur", "2", tuned),
        ]
    whole = Summary(found)
    assert whole.best("sand", "blur").setting == "2" and whole.best("rows", "blur").setting == "1"
    text = tables(found, 1)
    lines = {line.split("|")[1].strip(): line for line in text.splitlines() if line.startswith("| ")}
    assert "### Intersection over union" in text
    assert "behind the best peer's default in 1 of 2 families: rows." in text
    assert "uavseg 0.900; blur at its best setting in each family 0.970" in text
    assert "0.900" in lines["uavseg, default"] and "0.845" in lines["blur, default"]
    assert "0.970" in lines["blur, best"]


def test_the_section_prints_some_families_and_keeps_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = [method for method in methods() if method.who in ("uavseg", "Otsu")]
    monkeypatch.setattr(section, "methods", lambda words: few)
    monkeypatch.setattr(command.table, "keep", lambda *_: pytest.fail("a part of the table was kept"))
    command.main(["--quality", "--seeds", "1", "--families", "sand"])
    printed = capsys.readouterr().out
    assert "| sand " in printed and "| rows " not in printed and "adaptive, scan" in printed


@pytest.mark.parametrize(
    ("option", "told"),
    [("--families=moon", "no family begins with moon; there are blobs"), ("--refine=magic", "refinement is")],
)
def test_what_is_unknown_is_told(option: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        command.main(["--quality", option])
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("module", [metrics, peers, planes, section, shapes, summary])
def test_examples(module: object) -> None:
    found = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)  # type: ignore[arg-type]
    assert found.attempted and not found.failed


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_scenes_are_shown_beside_what_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "SHOWN", ("islands, noise 0.05", "glint"))
    pictures.picture(tmp_path / "scenes.png")
    with rasterio.open(tmp_path / "scenes.png") as file:
        shown = file.read([1, 2, 3]).reshape(3, -1).astype(int)
    red = (shown[0] > 200) & (shown[1] < 90) & (shown[2] < 90)
    assert 4_900 < red.sum() < 5_100  # islands that scans miss; matplotlib versions differ by some pixels
