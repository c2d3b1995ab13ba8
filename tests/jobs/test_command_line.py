"""Lines that are proposed: they read the same sources in the same way."""

import shlex
from contextlib import chdir
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given, strategies as st

from uavseg.access import allowing
from uavseg.cli.preview import info as command
from uavseg.jobs.info import extract_line, option_words, source_words
from uavseg.options.option import build
from uavseg.options.reading import ReadOptions
from uavseg.options.regions import InfoOptions

numbers = st.floats(-1e6, 1e6, allow_nan=False)
pairs = st.tuples(numbers, numbers).filter(lambda pair: pair[0] < pair[1])
stretches = st.one_of(
    st.sampled_from(["auto", "dtype", "minmax", "none"]),
    pairs.map(lambda pair: f"{pair[0]!r},{pair[1]!r}"),
    st.tuples(st.integers(0, 40), st.floats(41, 100)).map(lambda pair: f"percentile:{pair[0]},{pair[1]!r}"),
)
readings = st.builds(
    ReadOptions,
    band=st.none() | st.integers(1, 20) | st.sampled_from(["nir", "Band 8 - NIR"]),
    rgb=st.none() | st.tuples(*[st.integers(1, 9) | st.sampled_from(["red", "B8A"])] * 3),
    nodata=st.none() | numbers | numbers.map("only:{!r}".format) | st.just("none"),
    stretch=stretches,
    skip_bad_tiles=st.booleans(),
    index=st.none() | st.just("ndvi"),
    expr=st.none() | st.sampled_from(["-b1 + 2", "(nir - red) / 'a b'"]),
    band_names=st.none() | st.just("red,green,blue,nir"),
)


@given(readings)
def test_options_of_a_line_are_those_that_were_given(options: ReadOptions) -> None:
    words = ["a.tif", *option_words(options)]
    with command.make_context("info", words) as context:
        assert build(InfoOptions, context.params).read == options


@given(st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1), min_size=1))
def test_names_of_a_line_come_through_a_shell(names: list[str]) -> None:
    words = shlex.split(extract_line(names, ReadOptions(), "0.5,1"))
    assert words == ["uavseg", "extract", *source_words(names), "--range", "0.5,1"]
    assert [word.removeprefix("./") for word in source_words(names)] == [
        name.removeprefix("./") for name in names
    ]


def test_what_may_be_named_is_part_of_the_line(tmp_path: Path) -> None:
    with allowing(tmp_path, allow_network=True):
        line = extract_line(["a.tif"], ReadOptions(), "0,1")
    assert line == f"uavseg extract a.tif --allow-path {tmp_path} --allow-network --range 0,1"


@pytest.mark.parametrize("count", [8, 9, 40])
def test_many_names_become_a_pattern_that_stands_for_just_them(tmp_path: Path, count: int) -> None:
    with chdir(tmp_path):
        Path("my tiles").mkdir()
        names = [f"my tiles/{k:02}.tif" for k in range(count)]
        for name in names:
            Path(name).touch()
        assert source_words(names) == (names if count <= 8 else ["my tiles/*.tif"])
        assert source_words(names[1:]) == names[1:]
        assert source_words(names[::-1]) == names[::-1]  # the first of a mosaic lies on top
        assert source_words([*names, "other.tif"]) == [*names, "other.tif"]


@pytest.mark.slow
def test_the_line_of_info_runs(tmp_path: Path) -> None:
    from uavseg.cli import main

    tile = Path(__file__).resolve().parents[2] / "samples" / "fields_rgb.tif"
    with chdir(tmp_path):
        for name in ("a b.tif", "-c.tif"):
            Path(name).write_bytes(tile.read_bytes())
        words = ["--rgb", "3,2,1", "--nodata", "0", "--stretch", "5,250.5", "--", "a b.tif", "-c.tif"]
        told = CliRunner().invoke(main, ["info", *words])
        line = told.output.splitlines()[-1].removeprefix("try        uavseg ")
        assert "'a b.tif' ./-c.tif --rgb 3,2,1 --nodata 0 --stretch 5,250.5" in line
        done = CliRunner().invoke(main, [*shlex.split(line), "-o", "out.gpkg"])
        assert done.exit_code == 0 and Path("out.gpkg").exists(), done.output
        assert "stretch     5,250.5" in done.stderr and "luminance of bands 3,2,1" in done.stderr
