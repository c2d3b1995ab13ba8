"""What an algorithm refuses, and what it says."""

import stat
from pathlib import Path
from typing import Any

import pytest

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
QUARRY = SAMPLES / "quarry.tif"


@pytest.mark.slow
@pytest.mark.parametrize(
    "target", ["memory:", "ogr:dbname='x.gpkg' table=t", "postgres://x", "relative.gpkg"]
)
def test_an_output_that_is_not_a_file_is_refused(target: str, qgis: Any) -> None:
    answer = qgis.run("extract", INPUT=QUARRY, OUTPUT=target)
    assert answer.code == 1
    assert "is not a path of a file; uavseg writes files" in answer.log, answer.log
    assert "Traceback" not in answer.log


@pytest.mark.slow
def test_a_format_that_uavseg_does_not_write_is_refused(qgis: Any, tmp_path: Path) -> None:
    answer = qgis.run("extract", INPUT=QUARRY, OUTPUT=tmp_path / "o.tab")
    assert answer.code == 1
    assert "ends in none of .gpkg, .geojson, .fgb, .shp" in answer.log, answer.log
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_error_of_the_program_is_the_error_of_the_algorithm(qgis: Any, tmp_path: Path) -> None:
    answer = qgis.run("extract", INPUT=QUARRY, RANGE="0.9,0.2", OUTPUT=tmp_path / "o.gpkg")
    assert answer.code == 1
    assert "0.9,0.2" in answer.log and "Traceback" not in answer.log
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_error_of_the_program_names_the_fields_of_the_dialog(qgis: Any, tmp_path: Path) -> None:
    """`inside` tries the other algorithms."""
    answer = qgis.run("levels", INPUT=QUARRY, WIDTH=0.2, BREAKS="0.5", OUTPUT=tmp_path / "o.gpkg")
    assert answer.code == 1
    assert "give “Width of a level in v” P, or “Breaks” V,V,..." in answer.log, answer.log
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_mission_that_must_not_be_flown_fails_with_its_reason(qgis: Any, tmp_path: Path) -> None:
    mission = tmp_path / "m.plan"
    regions = tmp_path / "r.gpkg"
    qgis.typed("extract", QUARRY, "--range", "0.55,1", "-o", regions)
    qgis.typed("plan", regions, "-o", mission, "--altitude", "60", "--home", "auto")
    answer = qgis.run("check", INPUT=mission, MAX_ALTITUDE=50, REPORT=tmp_path / "r.json")
    assert answer.code == 1
    assert "60" in answer.log and "50" in answer.log
    assert (tmp_path / "r.json").read_text() == qgis.typed(
        "check", mission, "--max-altitude", "50", "--json", code=1
    )


@pytest.mark.slow
def test_a_flight_that_is_too_high_is_not_written(qgis: Any, tmp_path: Path) -> None:
    regions = tmp_path / "r.gpkg"
    qgis.typed("extract", QUARRY, "--range", "0.55,1", "-o", regions)
    answer = qgis.run(
        "plan", REGIONS=regions, ALTITUDE=300, OUTPUT=tmp_path / "m.plan", LEGS=tmp_path / "l.gpkg"
    )
    assert answer.code == 1
    assert "120" in answer.log and "Traceback" not in answer.log
    assert [path.name for path in tmp_path.iterdir()] == ["r.gpkg"]


def _program(path: Path, text: str) -> Path:
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "words"),
    [
        (None, "is not a file"),
        ("echo uavseg 9.0.1", "is uavseg 9.0.1; this plugin works with 1.0 or later, before 2.0"),
        ("echo something else", "is not uavseg"),
        ("echo broken >&2; exit 3", "does not run: broken"),
    ],
)
def test_a_program_that_is_missing_or_another_is_named_with_what_to_type(
    script: str | None, words: str, qgis: Any, tmp_path: Path
) -> None:
    program = tmp_path / "uavseg"
    if script is not None:
        _program(program, script)
    environment = {**qgis.environment, "UAVSEG_PROGRAM": str(program)}
    other = type(qgis)(environment, program)
    if script is None:  # the algorithms are listed all the same
        assert "uavseg:extract\tExtract regions" in other.call("list").stdout
    answer = other.run("extract", INPUT=QUARRY, OUTPUT=tmp_path / "o.gpkg")
    assert answer.code == 1
    assert words in answer.log and "type: python3 -m venv" in answer.log, answer.log
    assert not (tmp_path / "o.gpkg").exists()


@pytest.mark.slow
def test_the_program_sees_nothing_of_the_libraries_of_qgis(qgis: Any, tmp_path: Path) -> None:
    seen = tmp_path / "seen.txt"
    program = _program(
        tmp_path / "uavseg", f'[ "$1" = --version ] && echo uavseg 1.0.0 && exit\nenv > {seen}\nexit 1'
    )
    leaked = dict.fromkeys(
        ("PROJ_LIB", "PROJ_DATA", "GDAL_DATA", "LD_LIBRARY_PATH", "VIRTUAL_ENV"), "/nowhere"
    )
    other = type(qgis)({**qgis.environment, **leaked, "UAVSEG_PROGRAM": str(program)}, program)
    assert other.run("extract", INPUT=QUARRY, OUTPUT=tmp_path / "o.gpkg").code == 1
    names = {line.split("=")[0] for line in seen.read_text().splitlines()}
    assert "PATH" in names and not names & {*leaked, "PYTHONHOME", "PYTHONPATH"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [  # `inside` looks at the help of each parameter
        *("extract", "plan"),
        *(
            pytest.param(name, marks=pytest.mark.thorough)
            for name in (
                *("levels", "match", "suggest", "suggestlike", "check", "classify", "path"),
                *("footprints", "gaps", "georeference"),
            )
        ),
    ],
)
def test_all_algorithms_have_help_and_parameters_with_help(name: str, qgis: Any) -> None:
    text = qgis.call("help", f"uavseg:{name}").stdout
    assert "Arguments" in text and len(text) > 500 and "Traceback" not in text
