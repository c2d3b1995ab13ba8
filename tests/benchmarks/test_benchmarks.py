"""The benchmarks measure and print the right quantities; no test depends on speed."""

import doctest
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis.strategies import integers

from benchmarks import __main__ as command, data, paths, robot, scale, startup, table
from benchmarks.competitors import COMPETITORS, Competitor, Job, select_competitors
from benchmarks.decode import decoding_s
from benchmarks.measure import CommandError, Cost, Outcome, cost, run_competitors
from benchmarks.phases import TIMED_FUNCTIONS, phases
from benchmarks.polygon_stats import polygon_stats
from benchmarks.robot import Step
from benchmarks.scenes import KINDS, Scene
from benchmarks.startup import imported
from benchmarks.vectors import vectorised

pytestmark = pytest.mark.slow


def make_raster(scene: Scene, folder: Path) -> Path:
    path = folder / f"{scene.kind}-{scene.side}.tif"
    data.write(scene, path)
    return path


def pixels(path: Path) -> np.ndarray:
    with rasterio.open(path) as file:
        return file.read()


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_is_reproducible_and_the_corner_of_a_larger_one(kind: str, tmp_path: Path) -> None:
    small = pixels(make_raster(Scene(500, kind), tmp_path))
    again = pixels(make_raster(Scene(500, kind), tmp_path))
    large = pixels(make_raster(Scene(530, kind), tmp_path))
    assert np.array_equal(small, again)
    assert np.array_equal(small, large[:, :500, :500])


@given(row=integers(0, 40), col=integers(0, 40), step=integers(16, 900))
@settings(max_examples=20)
def test_the_terrain_is_continuous_across_tiles(row: int, col: int, step: int) -> None:
    here = data.Terrain(512 * row, 512 * col).noise(step, 1)
    right = data.Terrain(512 * row, 512 * (col + 1)).noise(step, 1)
    below = data.Terrain(512 * (row + 1), 512 * col).noise(step, 1)
    steepest = 1.5 * 2 / step + 1e-5  # slope of the interpolation, times the range of the values
    assert np.abs(here[:, -1] - right[:, 0]).max() <= steepest
    assert np.abs(here[-1] - below[0]).max() <= steepest


def test_a_scene_is_stored_with_the_documented_layout(tmp_path: Path) -> None:
    with rasterio.open(make_raster(Scene(520, "rgb8"), tmp_path)) as file:
        assert file.shape == (520, 520) and file.count == 3
        assert file.block_shapes == [(512, 512)] * 3
        assert file.compression.name == "deflate"
        assert file.crs.to_epsg() == 32633 and file.res == (0.5, 0.5)


def test_a_scene_has_bright_and_dark_areas_and_no_repetition() -> None:
    tiles = [data.draw(Scene(4096), row, col)[0] for row in (0, 512, 2048) for col in (0, 2048)]
    bright = np.mean([tile > 0.55 * 255 for tile in tiles])
    assert 0.2 < bright < 0.7
    assert len({tile.tobytes() for tile in tiles}) == 6


def test_the_queue_of_drawn_tiles_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []

    def draw(scene: Scene, row: int, col: int) -> np.ndarray:
        drawn.append(col)
        return np.zeros((1, 1, 1), np.uint8)

    monkeypatch.setattr(data, "draw", draw)
    monkeypatch.setattr(data.os, "cpu_count", lambda: 2)
    tiles = data._drawn(Scene(512), [(0, col) for col in range(100)])
    next(tiles)
    assert len(drawn) <= 5
    assert len(list(tiles)) == 99 and len(drawn) == 100


def test_colour_scenes_have_the_luminance_of_grey_scenes() -> None:
    grey = data.draw(Scene(512, "float32"), 0, 0)[0]
    red, green, blue = data.draw(Scene(512, "rgb8"), 0, 0) / 255.0
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    assert abs(float(np.mean(luminance - grey))) < 0.002
    assert not np.array_equal(red, green)


@pytest.mark.parametrize("side, kind", [(0, "grey8"), (512, "grey7")])
def test_an_invalid_scene_is_rejected(side: int, kind: str) -> None:
    with pytest.raises(ValueError, match="scene"):
        Scene(side, kind)


def test_the_cost_of_a_command_excludes_that_of_others() -> None:
    hold = cost([sys.executable, "-c", "held = bytearray(300_000_000)"], {})
    spend = cost([sys.executable, "-c", "import time\nwhile time.process_time() < 0.3: pass"], {})
    assert hold.peak_bytes > 300e6
    assert 0.3 <= spend.cpu_s <= spend.wall_s * 2


def test_a_failing_command_reports_its_error() -> None:
    with pytest.raises(CommandError, match="code 1: ValueError: no such thing"):
        cost([sys.executable, "-c", "raise ValueError('no such thing')"], {})


def test_competitors_take_turns_and_failing_ones_are_left_out(tmp_path: Path) -> None:
    def competitor(name: str, code: str = "pass") -> Competitor:
        return Competitor(name, name, lambda job: [[sys.executable, "-c", code]])

    reported: list[str] = []
    raster = tmp_path / "empty.tif"
    raster.touch()
    absent = Competitor("c", "c", lambda job: [], requires=("no_such_module",))
    field = [competitor("a"), competitor("b", "raise SystemExit('broken')"), absent, competitor("d")]
    found = run_competitors(Scene(8), raster, field, 2, lambda path: (1, 2.0, 0), reported.append)
    assert [line.split(":")[0] for line in reported] == [
        "8² round 1 a",
        "8² b",
        "8² round 1 d",
        "8² round 2 a",
        "8² round 2 d",
    ]
    assert [len(outcome.costs) for outcome in found] == [2, 0, 0, 2]
    assert "broken" in found[1].remark and "no_such_module" in found[2].remark


def test_a_competitor_may_be_limited_to_small_scenes() -> None:
    [slic] = select_competitors(["slic"])
    assert "2048" in (slic.skip_reason(Scene(4096)) or "")


def test_an_unknown_competitor_is_rejected() -> None:
    with pytest.raises(ValueError, match="uavseg, opencv"):
        select_competitors(["nobody"])


def cells(lines: list[str], title: str) -> list[str]:
    [row] = [line for line in lines if line.startswith(f"| {title}")]
    return [cell.strip() for cell in row.split("|")[2:-1]]


def test_the_table_holds_medians_ratios_and_remarks() -> None:
    ours, theirs, missing = COMPETITORS[:3]
    scene = Scene(2048)
    costs = tuple(Cost(wall, 1.0, 100_000_000) for wall in (5.0, 2.0, 1.0))
    slow = tuple(Cost(wall, 9.0, 300_000_000) for wall in (4.0, 6.0, 5.0))
    text = table.processes(
        [
            Outcome(ours, scene, costs, (12, 3e6, 0)),
            Outcome(theirs, scene, slow, (13, 3.1e6, 1)),
            Outcome(missing, scene, remark="Python has no scipy"),
        ],
        3,
    )
    lines = text.splitlines()
    [first] = [line for line in lines if line.startswith(f"| {ours.title}")]
    [second] = [line for line in lines if line.startswith(f"| {theirs.title}")]
    assert [cell.strip() for cell in first.split("|")[2:-1]] == [
        "2.00",
        "1.00",
        "100",
        "12",
        "3.000",
        "0",
        "1.00",
    ]
    assert [cell.strip() for cell in second.split("|")[2:-1]] == [
        "5.00",
        "9.00",
        "300",
        "13",
        "3.100",
        "1",
        "2.50",
    ]
    assert "- usual: Python has no scipy" in lines
    assert len({len(line) for line in lines if line.startswith("|")}) == 1


def test_a_section_is_replaced_and_the_rest_of_the_document_stays() -> None:
    before = "# Title\n\n<!-- startup -->\nold\n<!-- /startup -->\n\nend\n"
    once = table.replace_section(before, "startup", "new")
    assert "old" not in once and once.startswith("# Title") and once.endswith("\n\nend\n")
    assert table.replace_section(once, "startup", "new") == once
    with pytest.raises(ValueError, match="kernels"):
        table.replace_section(before, "kernels", "new")


def test_every_section_has_markers_in_its_document() -> None:
    for section in command._SECTIONS:
        table.replace_section(command._DOCUMENTS.get(section, table.README).read_text(), section, "")


def test_a_repeated_scene_is_a_tiling_of_the_scene(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(scale, "REPEATED", 520)
    [once, twice] = [pixels(scale.repeated(side, tmp_path))[0] for side in (520, 1040)]
    assert np.array_equal(once, pixels(tmp_path / "grey8-520.tif")[0])
    assert np.array_equal(twice, np.tile(once, (2, 2)))


def test_costs_are_given_per_pixel_and_per_decoded_byte(tmp_path: Path) -> None:
    small, large = Scene(1000), Scene(500, "rgb8")
    runs = [scale.Run(small, Cost(2.0, 3.0, 200_000_000), 0.5), scale.Run(large, Cost(9.0, 9.0, 1), 0.5)]
    lines = table.scaling(runs, 3).splitlines()
    assert cells(lines, "1000²") == ["2.00", "3.00", "200", "2000.0", "3000.0", "0.50"]
    lines = table.pixel_types(runs, 3).splitlines()
    assert cells(lines, "500² rgb8") == ["9.00", "9.00", "0", "12000.0", "6.00", "0.50"]


def test_decoding_a_file_takes_time(tmp_path: Path) -> None:
    assert 0 < decoding_s(make_raster(Scene(600, "rgb8"), tmp_path), 2) < 60


def test_phases_sum_to_the_total(tmp_path: Path) -> None:
    found = {phase.title: phase.seconds for phase in phases(make_raster(Scene(1024), tmp_path))}
    assert sum(found.values()) == pytest.approx(2 * found["total"])
    idle = [title for title, seconds in found.items() if seconds == 0]
    assert idle == []  # a function with an outdated name is never timed


def test_the_readme_has_a_row_for_every_timed_function() -> None:
    readme = table.README.read_text()
    assert [title for _, _, title in TIMED_FUNCTIONS if f"| {title} " not in readme] == []


def test_uavseg_and_rasterio_give_the_same_polygons() -> None:
    found = vectorised(600, 1)
    assert found.regions == pytest.approx((600 / 25.92) ** 2, rel=0.1)
    assert found.identical == found.parts >= found.regions
    assert min(found.uavseg_s, found.one_thread_s, found.rasterio_s) > 0


def test_the_measurements_of_child_processes_return_times(tmp_path: Path) -> None:
    raster = make_raster(Scene(512), tmp_path)
    assert scale._measure_segmentation(str(raster), "2") > (0,)
    assert scale._measure_independent_work("1") > (0,)
    blocks = tmp_path / "blocks.tif"
    cost([sys.executable, "-m", "uavseg", "divide", str(raster), "-q", "-o", str(blocks)], dict(os.environ))
    assert min(scale._measure_reuse(str(raster), str(blocks))) > 0


@pytest.mark.slow
def test_commands_are_measured_at_each_size(tmp_path: Path) -> None:
    raster = make_raster(Scene(512), tmp_path)
    lines: list[str] = []
    found = scale.commands({512: raster}, 1, lines.append)
    assert list(found) == list(scale.COMMANDS) and len(lines) == len(found)
    assert all(list(by_side) == [512] for by_side in found.values())


def test_commands_are_compared_with_the_first_and_their_slope_is_that_of_time() -> None:
    found = {
        "extract": {512: Cost(1, 1, 2 << 20), 1024: Cost(4, 2, 3 << 20)},
        "map": {512: Cost(2, 3, 4 << 20), 1024: Cost(2, 5, 4 << 20)},
    }
    lines = [line for line in table.commands({"grey8": found}, 1).splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if "²" not in line]
    assert ["extract", "1.00", "4.00", "1.00", "2", "3", "1.00"] in cells
    assert ["map", "2.00", "2.00", "0.00", "4", "4", "2.50"] in cells


def test_the_table_separates_merging_from_segmenting() -> None:
    output = table.robot([Step("update", 2.5, 1.0, 35.0, "a room"), Step("refit", 9.0, 0.0, 1024.0)])
    assert "| update | 2.50 |    1.00 |       1.50 |     35 | a room |" in output
    assert "| refit  | 9.00 |         |       9.00 |   1024 |        |" in output


def test_the_walls_of_the_room_are_at_the_documented_range() -> None:
    ranges = np.concatenate([scan.ranges for scan in robot.scans(robot.room(), 220)[::20]])
    assert len(ranges) == 11 * 720 and np.isfinite(ranges).all()
    assert ranges.min() > 1.5 and 12 < ranges.max() < 22 and 5 < np.median(ranges) < 12


def test_imports_are_summed_by_package_from_their_self_times() -> None:
    lines = [
        "self [us] | cumulative | imported",
        "  1500 |   2500 |   os",
        "   500 |   500 |     os.path",
        "  900 | 900 | re",
    ]
    reported = "\n".join(f"import time: {line}" for line in lines) + "\nother 3"
    assert [(one.package, one.modules, one.seconds) for one in imported(reported)] == [
        ("os", 2, 0.002),
        ("re", 1, 0.0009),
    ]


@pytest.mark.parametrize("module", [table, startup])
def test_docstring_examples(module: ModuleType) -> None:
    found = doctest.testmod(module)
    assert found.attempted and not found.failed


@pytest.mark.parametrize("name", ["uavseg", "opencv", "gdal", "pipeline"])
def test_a_competitor_extracts_the_bright_area(name: str, tmp_path: Path) -> None:
    [competitor] = select_competitors([name])
    scene = Scene(512)
    reason = competitor.skip_reason(scene)
    if reason:
        pytest.skip(reason)
    raster = make_raster(scene, tmp_path)
    [outcome] = run_competitors(scene, raster, [competitor], 1, polygon_stats, lambda line: None)
    assert outcome.remark == "" and outcome.stats is not None
    polygons, area_m2, invalid = outcome.stats
    bright_m2 = 0.25 * np.count_nonzero(pixels(raster) > 0.55 * 255)
    assert polygons > 3 and invalid == 0
    assert area_m2 == pytest.approx(bright_m2, rel=0.05)


def test_options_select_sections_and_partial_tables_are_not_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    readme = tmp_path / "README.md"
    readme.write_text("<!-- startup --><!-- /startup -->")

    def section(text: str) -> Callable[..., str]:
        return lambda options: text

    monkeypatch.setattr(command, "_SECTIONS", {"processes": section("who"), "startup": section("when")})
    command.main(["--startup", "--readme", str(readme)])
    assert "when" in readme.read_text()
    command.main(["--only", "uavseg", "--readme", str(readme)])
    assert "who" in capsys.readouterr().out and "who" not in readme.read_text()


def test_the_gdal_chain_reads_each_band_of_a_colour_scene(tmp_path: Path) -> None:
    [gdal] = select_competitors(["gdal"])
    if gdal.skip_reason(Scene(512)):
        pytest.skip("the GDAL programs are not installed")
    calc = gdal.commands(Job(Scene(512, "rgb8"), tmp_path / "in.tif", tmp_path / "out.gpkg"))[0]
    assert [argument for argument in calc if "_band" in argument] == [
        "--A_band=1",
        "--B_band=2",
        "--C_band=3",
    ]
    assert "--calc=0.2126*A.astype(float) + 0.7152*B + 0.0722*C >= 140.25" in calc


def test_all_libraries_find_paths_of_equal_length_except_for_cut_corners() -> None:
    for field in paths.fields(48):
        found = {row.library: row.cost for row in paths.measure(field, tuple(paths.SEARCHES), 1)}
        assert found["networkx"] == pytest.approx(found["uavseg"])
        assert found["pathfinding"] == pytest.approx(found["uavseg"])
        assert found["scikit-image"] <= found["uavseg"] + 1e-9


def test_a_library_that_is_not_installed_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(paths.MODULES, "networkx", "no_such_module")
    assert set(paths.SEARCHES) - set(paths.installed(paths.SEARCHES)) == {"networkx"}


def test_a_maze_is_a_tree() -> None:
    mask = paths.maze(61)
    cells = int(mask.sum())
    edges = int((mask[1:] & mask[:-1]).sum() + (mask[:, 1:] & mask[:, :-1]).sum())
    assert cells == edges + 1 == 2 * 30 * 30 - 1
    assert not np.array_equal(mask, paths.maze(61, seed=1)) and np.array_equal(mask, paths.maze(61))
