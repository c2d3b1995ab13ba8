"""`uavseg suggest`, from the command line to the line that is typed next."""

import json
import shlex
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result

import uavseg
from uavseg.cli import main

ROOT = Path(__file__).resolve().parents[2]
QUARRY = ROOT / "samples" / "quarry.tif"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def called(*words: object) -> Result:
    return CliRunner().invoke(main, [*map(str, words)])


def done(*words: object) -> Result:
    result = called(*words)
    assert result.exit_code == 0, result.output
    return result


def write(name: str, image: np.ndarray, col: int = 0, nodata: float | None = 0) -> str:
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5 + 2 * col, 0, -2, 5e6), "nodata": nodata}
    with rasterio.open(name, "w", "GTiff", *image.shape[::-1], 1, dtype=image.dtype.name, **place) as file:
        file.write(image, 1)
    return name


def fields(seed: int = 1, shape: tuple[int, int] = (200, 192), kind: str = "uint8") -> np.ndarray:
    rng = np.random.default_rng(seed)
    coarse = rng.choice([40, 120, 210], (shape[0] // 32 + 1, shape[1] // 32 + 1))
    image = np.kron(coarse, np.ones((32, 32)))[: shape[0], : shape[1]] + rng.normal(0, 9, shape)
    return np.clip(image, 1, 255).astype(kind)


def metadata(*words: object) -> list[dict[str, object]]:
    ranges: list[dict[str, object]] = json.loads(done("suggest", *words, "--json").stdout)["ranges"]
    return ranges


def test_people_read_a_table_and_the_line_to_type_next() -> None:
    result = done("suggest", write("a.tif", fields()))
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["v", "values", "area", "regions", "contrast"]
    assert len(lines) == 7 and result.stderr == ""
    [darkest] = [line.split() for line in lines[1::2] if line.startswith("0 to 0.")]
    assert darkest[7] == "%" and float(darkest[9]) > 2.5
    assert float(darkest[5]) == pytest.approx(255 * float(darkest[2]), abs=1e-3)
    shares = [float(line.split()[6]) for line in lines[1::2]]
    assert sum(shares) == pytest.approx(100, abs=0.16)
    assert all(line.startswith("    uavseg extract a.tif --range 0") for line in lines[2::2])


@pytest.mark.slow
def test_the_lines_run_and_give_what_was_said() -> None:
    write("a b.tif", fields(2, kind="uint16"), nodata=None)
    how = ("--stretch", "0,255", "--nodata", 7, "--method", "paper", "--threshold", 1.5, "--band", 1)
    ranges = metadata("a b.tif", *how, "--tile", 128, "--threads", 1)
    assert len(ranges) >= 2
    for found in ranges:
        words = shlex.split(str(found["command"]))
        assert words[0] == "uavseg" and not {"--tile", "--threads", "--json"} & set(words)
        assert {"--stretch", "--nodata", "--method", "--threshold", "--band"} <= set(words)
        done(*words[1:], "-q")
        assert len(geopandas.read_file(words[-1])) == found["regions"]


def test_programs_read_json() -> None:
    name = write("a.tif", fields())
    answer = json.loads(done("suggest", name, "--json", "--classes", 4).stdout)
    assert (
        answer["source"] == "a.tif" and answer["stretch"].startswith("dtype") and 0 < answer["explained"] <= 1
    )
    ranges = uavseg.suggest(name, 4)
    keys = ("low", "high", "pixels", "share", "regions")
    assert [[found[key] for key in keys] for found in answer["ranges"]] == [
        [getattr(found, key) for key in keys] for found in ranges
    ]


@pytest.mark.slow
def test_the_picture_is_the_same_for_any_tiles_and_threads() -> None:
    name = write("a.tif", fields(3, (330, 270)))
    told = done("suggest", name, "-o", "one.png", "--tile", 64, "--threads", 1)
    assert told.stderr == "wrote one.png\n"
    other = done("suggest", name, "-o", "two.png", "--tile", 192, "--threads", 2, "-q")
    assert other.stderr == "" and other.stdout == told.stdout
    assert Path("one.png").read_bytes() == Path("two.png").read_bytes()


@pytest.mark.slow
def test_a_block_map_answers_without_its_raster() -> None:
    wanted = metadata(write("a.tif", fields(4)))
    done("divide", "a.tif", "-o", "blocks.tif", "-q")
    there = metadata("blocks.tif")
    Path("a.tif").unlink()
    found = metadata("blocks.tif", "-o", "look.png")
    assert Path("look.png").stat().st_size > 10_000
    for one, two, other in zip(wanted, there, found, strict=True):
        assert one | {"command": ""} == two | {"command": ""}
        assert other["share"] == pytest.approx(one["share"], abs=0.02)
        words = shlex.split(str(other["command"]))
        assert words[1:4] == ["extract", "blocks.tif", "--range"]
        done(*words[1:], "-q")  # without its raster, regions end at block edges
        assert len(geopandas.read_file(words[-1])) == other["regions"]
    assert [chosen.range for chosen in uavseg.suggest("blocks.tif")] == [(f["low"], f["high"]) for f in found]


@pytest.mark.slow
def test_many_rasters_are_one_mosaic() -> None:
    image = fields(5)
    wanted = metadata(write("a.tif", image))
    parts = [write(f"{k}.tif", image[:, 16 * k : 16 * k + 16], 16 * k) for k in range(12)]
    found = metadata(*parts)
    assert [one | {"command": ""} for one in found] == [one | {"command": ""} for one in wanted]
    assert "0.tif 1.tif 2.tif 3.tif 4.tif 5.tif 6.tif 7.tif 8.tif 9.tif 10.tif" in str(found[0]["command"])
    for part in parts:
        Path(part).rename(f"{int(part[:-4]):02}.tif")
    beside = metadata(*sorted(map(str, Path().glob("[01]?.tif"))))  # *.tif would be a.tif too
    assert str(beside[0]["command"]).startswith("uavseg extract 00.tif 01.tif 02.tif")
    Path("a.tif").unlink()
    tiles = metadata(*sorted(map(str, Path().glob("*.tif"))))
    assert str(tiles[0]["command"]).startswith("uavseg extract '*.tif' --range")
    done(*shlex.split(str(tiles[0]["command"]))[1:], "-q")
    for part in Path().glob("[01]?.tif"):
        part.rename(f"{int(part.stem)}.tif")
    assert "0.tif 1.tif 2.tif --range" in str(metadata(*parts[:3])[0]["command"])


@pytest.mark.slow
def test_a_run_goes_on_where_it_stopped() -> None:
    how = ("suggest", write("a.tif", fields(6)), "--tile", 64, "--resume", "kept")
    wanted = done(*how).stdout
    again = done(*how)
    assert "resumed: 12 of 12 tiles were done" in again.stderr and again.stdout == wanted


def test_more_is_said_to_those_who_ask() -> None:
    told = done("suggest", QUARRY, "-v", "--progress", "plain").stderr
    assert "of the variance of the means lies between the ranges" in told and "progress 100" in told


@pytest.mark.slow
def test_one_class_is_an_answer() -> None:
    result = done("suggest", write("a.tif", np.full((70, 80), 51, np.uint8)), "-o", "look.png")
    assert result.stdout == "one class: there is no range to choose\n"
    assert "uavseg: warning: all leaves have the mean v = 0.2" in result.stderr and Path("look.png").exists()
    assert metadata("a.tif") == []
    [told] = json.loads(done("suggest", "a.tif", "--json", "-q").stdout)["warnings"]
    assert "no range to choose" in told


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--classes", "1"], "ranges are 2 to 8 in number, not 1"),
        (["--classes", "9"], "ranges are 2 to 8 in number, not 9"),
        (["-o", "look.jpg"], "call it look.png"),
        (["-o", "there.png"], "there.png exists; give --overwrite"),
        (["-o", "no/look.png"], "the folder no does not exist"),
        (["--stretch", "loud"], "loud"),
        (["--tile", "65"], "a positive multiple of 64"),
        (["--intensity-step", "2"], "an intensity step lies in 0..1"),
        (["--band", "9"], "9"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_one_line_and_nothing_written(words: list[str], said: str) -> None:
    Path("there.png").write_text("mine")
    result = called("suggest", QUARRY, *words)
    lines = result.stderr.splitlines()
    assert result.exit_code == 1 and len(lines) == 1 and said in lines[0], result.output
    assert [path.name for path in Path().iterdir()] == ["there.png"] and result.stdout == ""
    assert Path("there.png").read_text() == "mine"


def test_rasters_that_cannot_be_answered_are_one_line() -> None:
    write("none.tif", np.zeros((70, 80), np.uint8))
    write("a.tif", fields())
    done("divide", "a.tif", "-o", "blocks.tif", "-q")
    for words, said in (
        (["none.tif"], "no pixel of none.tif is valid"),
        (["missing.tif"], "missing.tif"),
        (["blocks.tif", "--stretch", "minmax"], "a block map has its bands, nodata and stretch already"),
    ):
        result = called("suggest", *words, "-o", "look.png")
        assert result.exit_code == 1 and said in result.stderr and len(result.stderr.splitlines()) == 1
    assert not Path("look.png").exists()
    assert called("suggest", "a.tif", "--classes", "some").exit_code == 2 and called("suggest").exit_code == 2


def two_kinds(name: str) -> str:
    """Three bands; the first parts the left from the right."""
    rng = np.random.default_rng(5)
    left = np.indices((160, 192))[1] < 90
    planes = rng.normal(100, 9, (3, 160, 192)) + np.stack([50 * left, 0 * left, 0 * left])
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "photometric": "RGB"}
    with rasterio.open(name, "w", "GTiff", 192, 160, 3, dtype="uint8", **place) as file:
        file.write(np.rint(planes).astype(np.uint8))
    return name


LIKE = ("--like", "400080,4999840,40")


@pytest.mark.slow
def test_a_sample_is_answered_with_lines_that_find_its_kind() -> None:
    name = two_kinds("a b.tif")
    lines = done("suggest", name, *LIKE).stdout.splitlines()
    assert lines[0].split() == ["of", "values", "agreement", "area"]
    assert lines[1].startswith("band 1 ") and lines[1].endswith(" %")
    commands = [line.strip() for line in lines[2::2]]
    assert 1 <= len(commands) <= 3 and commands[0].startswith("uavseg extract 'a b.tif' --band 1 --values ")
    for command in commands:
        words = shlex.split(command)
        done(*words[1:], "-q")
        share = geopandas.read_file(words[-1]).to_crs(32618).area.sum() / (160 * 192 * 4)
        assert share == pytest.approx(90 / 192, abs=0.03)


@pytest.mark.slow
def test_the_answer_to_a_sample_as_json() -> None:
    answer = json.loads(done("suggest", two_kinds("a.tif"), *LIKE, "--json").stdout)
    assert answer["source"] == "a.tif" and answer["warnings"] == []
    [best, *_] = answer["ranges"]
    assert best["words"] == {"band": 1} and best["value_high"] is None and 0.8 < best["agreement"] <= 1
    assert best["command"].startswith("uavseg extract a.tif --band 1 --values ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--like", "1,2,3", "--classes", "3"], "--classes is for ranges without --like"),
        (["--like", "1,2,3", "-o", "a.png"], "--output is for ranges without --like"),
        (["--like", "1,2,3", "--threshold", "1.2"], "--threshold is for ranges without --like"),
    ],
)
def test_options_of_the_histogram_do_not_go_with_a_sample(words: list[str], message: str) -> None:
    result = called("suggest", two_kinds("a.tif"), *words)
    assert result.exit_code == 2 and message in result.output


@pytest.mark.parametrize("words", [["--like", "1,2,3"], ["--unlike", "400080,4999840,40"], ["--bands", "2"]])
def test_a_sample_that_does_not_fit_is_one_line(words: list[str]) -> None:
    result = called("suggest", two_kinds("a.tif"), *words)
    assert result.exit_code == 1 and result.output.count("\n") == 1 and "sample" in result.output
