"""Segmentation quality: properties of the scenes, laws of the metrics, and a result from every method."""

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
from benchmarks.quality.metrics import Metrics, boundary, boundary_f, iou, measure
from benchmarks.quality.run import Score, scores
from benchmarks.quality.scenes import BRIGHT, DARK, FAMILIES, RANGE, Cover, Scene, draw
from benchmarks.quality.summary import Summary
from benchmarks.quality.tables import tables
from uavseg.errors import ParameterError

pytestmark = pytest.mark.slow

SIDE = 160
SHAPES = [getattr(shapes, name) for name in ("blobs", "roads", "islands", "terraces", "holes", "parcels")]
SHAPES += [shapes.coast, shapes.country]
TEXTURES = [textures.smooth, textures.sand, textures.forest, textures.rows, textures.glint]


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def masks() -> SearchStrategy[np.ndarray]:
    return arrays(bool, array_shapes(min_dims=2, max_dims=2, min_side=3, max_side=12))


@pytest.mark.parametrize("name", FAMILIES)
def test_scenes_are_reproducible_and_depend_on_the_seed(name: str) -> None:
    first, again, other = (draw(FAMILIES[name], seed, SIDE) for seed in (0, 0, 1))
    assert np.array_equal(first.values, again.values)
    assert np.array_equal(first.truth, again.truth) and np.array_equal(first.valid, again.valid)
    assert not np.array_equal(first.values, other.values)


@pytest.mark.parametrize("shape", SHAPES)
def test_without_texture_and_noise_the_range_gives_the_ground_truth(shape: shapes.Shape) -> None:
    plain = Cover(textures.smooth, 0)
    scene = draw(
        replace(FAMILIES["sand"], shape=shape, objects=plain, background=plain, camera=Camera()), 3, SIDE
    )
    assert np.array_equal((scene.v >= RANGE[0]) & (scene.v <= RANGE[1]), scene.truth)
    assert 0.03 < scene.truth.mean() < 0.8
    found = measure(scene.truth, scene.truth, scene.valid)
    assert replace(found, vi=0) == Metrics(1, 1, 0, 1, 0) and found.vi == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("name", FAMILIES)
def test_objects_and_background_have_the_means_of_their_family(name: str) -> None:
    family = replace(FAMILIES[name], camera=Camera())
    scene = draw(family, 0, SIDE)
    for mask, tone in ((scene.truth, family.means[0]), (~scene.truth, family.means[1])):
        assert scene.v[mask].mean() == pytest.approx(tone, abs=0.004)


def test_a_threshold_does_not_separate_equal_mean_families() -> None:
    for family in FAMILIES.values():
        if family.equal_means:
            scene = draw(family, 0, 2 * SIDE)
            inside, outside = (float((scene.v[mask] > 0.55).mean()) for mask in (scene.truth, ~scene.truth))
            assert inside == pytest.approx(outside, abs=0.08)


@pytest.mark.parametrize("texture", TEXTURES)
def test_a_texture_has_mean_0_and_standard_deviation_1(texture: textures.Texture) -> None:
    plane = texture(SIDE, rng())
    assert plane.shape == (SIDE, SIDE)
    assert plane.mean() == pytest.approx(0, abs=1e-9) and plane.std() == pytest.approx(1)


def test_roads_have_the_requested_width() -> None:
    for width in range(3, 13):
        inside = shapes.road(400, width, rng(width))
        # Not at the edges of the image, where roads are cropped.
        deep = ndimage.distance_transform_edt(inside)[30:-30, 30:-30]
        assert deep.max() == pytest.approx(width / 2, abs=0.9)
        assert ndimage.label(inside, np.ones((3, 3)))[1] == 1


def test_islands_do_not_touch() -> None:
    inside = shapes.islands(280, rng())
    assert ndimage.label(inside)[1] == 100
    assert ndimage.label(inside, np.ones((3, 3)))[1] == 100


def test_noise_has_the_requested_standard_deviation() -> None:
    for noise in (0.05, 0.1):
        flat = replace(FAMILIES["blobs, no noise"], objects=Cover(strength=0), background=Cover(strength=0))
        scene = draw(replace(flat, camera=Camera(noise)), 0, SIDE)
        for mask, tone in ((scene.truth, BRIGHT), (~scene.truth, DARK)):
            assert (scene.v[mask] - tone).std() == pytest.approx(noise, rel=0.05)
            assert peers.noise_of(scene.v) == pytest.approx(noise, rel=0.1)


def test_each_camera_parameter_has_its_effect() -> None:
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
@settings(max_examples=50)
def test_a_mask_compared_with_itself_has_perfect_metrics(mask: np.ndarray) -> None:
    every = np.ones_like(mask)
    found = measure(mask, mask, every)
    assert (found.iou, found.boundary_f, found.vi, found.area_error) == (1, 1, pytest.approx(0, abs=1e-9), 0)
    assert found.region_ratio == (1 if mask.any() else 0)


@given(masks())
@settings(max_examples=50)
def test_metrics_equal_those_of_a_slow_reference_implementation(mask: np.ndarray) -> None:
    other, every = np.roll(mask, 1, axis=1), np.ones_like(mask)
    other[0] = False
    found, swapped = measure(other, mask, every), measure(mask, other, every)
    assert found.iou == swapped.iou == pytest.approx(slow_iou(other, mask))
    assert found.boundary_f == pytest.approx(swapped.boundary_f)
    assert found.boundary_f == pytest.approx(slow_f(other, mask))
    assert found.vi == pytest.approx(swapped.vi)
    assert found.vi == pytest.approx(slow_vi(components(other), components(mask)))


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


def components(mask: np.ndarray) -> np.ndarray:
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


def test_invalid_pixels_do_not_count_in_any_metric() -> None:
    truth = np.zeros((20, 20), bool)
    truth[5:15, 5:15] = True
    valid = np.ones_like(truth)
    valid[:, 12:] = False
    found = truth ^ ~valid
    assert measure(found, truth, valid) == measure(truth, truth, valid) == Metrics(1, 1, 0, 1, 0)
    assert not boundary(truth & valid, valid)[6:14, 11].any()  # the edge of the valid area is not a boundary


def test_fragmented_regions_raise_the_region_ratio() -> None:
    truth = np.ones((8, 8), bool)
    truth[0] = False
    found = truth.copy()
    found[:, [2, 5]] = False
    assert measure(found, truth, np.ones_like(truth)).region_ratio == 3
    assert measure(found, truth, np.ones_like(truth)).area_error == pytest.approx(2 / 8)
    assert iou(found, truth) == pytest.approx(6 / 8) and boundary_f(found, truth, found | ~found) < 1


@pytest.fixture(scope="module")
def easy() -> Scene:
    return draw(FAMILIES["collar"], 0, SIDE)


@pytest.mark.filterwarnings("ignore:The probability range is outside")  # random walker: rounding
@pytest.mark.parametrize("method", methods(), ids=lambda method: f"{method.name}: {method.setting}")
def test_every_method_returns_a_mask_of_valid_pixels(method: Method, easy: Scene) -> None:
    scene = easy if method.crop is None else easy.central_crop(128)
    found = method.segment(scene)
    assert found.shape == scene.truth.shape and found.dtype == bool
    assert not (found & ~scene.valid).any()
    if method.default and method.name in ("uavseg", "total variation", "blur and threshold"):
        assert iou(found, scene.truth) > 0.5


@pytest.mark.parametrize("method", methods(), ids=lambda method: f"{method.name}: {method.setting}")
def test_no_method_fails_on_a_uniform_scene(method: Method) -> None:
    dark = Cover(strength=0)
    family = replace(FAMILIES["sand"], objects=dark, background=dark, camera=Camera(), means=(0.3, 0.3))
    found = method.segment(draw(family, 0, 64))
    assert found.shape == (64, 64)


def test_every_method_has_one_default_and_unique_settings() -> None:
    known = methods(["smooth"])
    for name in {method.name for method in known}:
        assert sum(method.default for method in known if method.name == name) == 1
    assert len({method.key for method in methods()}) == len(methods())
    with pytest.raises(ParameterError, match="refinement"):
        methods(["magic"])


def test_scores_are_cached_and_do_not_depend_on_the_number_of_processes() -> None:
    few = [
        method
        for method in methods()
        if method.key in {("blur and threshold", "sigma 2"), ("Otsu", "sigma 2")}
    ]
    reported: list[str] = []
    first = scores(few, 1, ["sand", "rows"], report=reported.append)
    again = scores(few, 1, ["sand", "rows"], processes=1, report=reported.append)
    assert len(reported) == 2 and again == first
    assert [(score.family, score.method) for score in first] == list(product(["sand", "rows"], few))


def make_score(family: str, name: str, setting: str, iou: float, **more: object) -> Score:
    method = Method(name, setting, peers.blur_threshold, "uavseg" if name == "uavseg" else "peer", **more)  # type: ignore[arg-type]
    return Score(family, 0, method, Metrics(iou, iou, 0.5, 1, 0.1), 0.1)


def test_the_tables_name_the_best_peer_of_each_family() -> None:
    families = {"sand": (0.9, 0.8, 0.7, 0.95), "rows": (0.9, 0.8, 0.99, 0.6)}
    found = []
    for family, (us, other, plain, tuned) in families.items():
        found += [
            make_score(family, "uavseg", "default", us, default=True),
            make_score(family, "uavseg", "paper", other),
            make_score(family, "blur", "1", plain, default=True),
            make_score(family, "blur", "2", tuned),
        ]
    aggregated = Summary(found)
    assert aggregated.best("sand", "blur").setting == "2" and aggregated.best("rows", "blur").setting == "1"
    text = tables(found, 1)
    lines = {line.split("|")[1].strip(): line for line in text.splitlines() if line.startswith("| ")}
    assert "### Intersection over union" in text
    assert "behind the best peer's default in 1 of 2 families: rows." in text
    assert "uavseg 0.900; blur at its best setting in each family 0.970" in text
    assert "0.900" in lines["uavseg, default"] and "0.845" in lines["blur, default"]
    assert "0.970" in lines["blur, best"]


def test_a_subset_of_families_is_printed_and_not_written(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = [method for method in methods() if method.name in ("uavseg", "Otsu")]
    monkeypatch.setattr(section, "methods", lambda refinements: few)
    monkeypatch.setattr(command.table, "write_section", lambda *_: pytest.fail("a partial table was written"))
    command.main(["--quality", "--seeds", "1", "--families", "sand"])
    printed = capsys.readouterr().out
    assert "| sand " in printed and "| rows " not in printed and "adaptive, scan" in printed


@pytest.mark.parametrize(
    ("option", "reported"),
    [("--families=moon", "no family begins with moon; there are blobs"), ("--refine=magic", "refinement is")],
)
def test_unknown_families_and_refinements_are_reported(
    option: str, reported: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        command.main(["--quality", option])
    assert reported in capsys.readouterr().err


@pytest.mark.parametrize("module", [metrics, peers, planes, section, shapes, summary])
def test_docstring_examples(module: object) -> None:
    found = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)  # type: ignore[arg-type]
    assert found.attempted and not found.failed


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_the_figure_shows_the_pixels_that_scans_miss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "SHOWN", ("islands, noise 0.05", "glint"))
    pictures.draw_figure(tmp_path / "scenes.png")
    with rasterio.open(tmp_path / "scenes.png") as file:
        shown = file.read([1, 2, 3]).reshape(3, -1).astype(int)
    red = (shown[0] > 200) & (shown[1] < 90) & (shown[2] < 90)
    # Islands that the scans miss; the number of pixels differs slightly between versions of matplotlib.
    assert 4_900 < red.sum() < 5_100
