"""`uavseg resume`: the rest of a mission in each format, bad input, and nothing that is left behind."""

import json
import warnings
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from tests.flight.flight_logs import dataflash
from tests.flight.test_resume import by_hand, setting
from uavseg.cli import main
from uavseg.flight.formats import files
from uavseg.flight.formats.files import read_mission
from uavseg.flight.mission.mission import Mission

MISSION = by_hand(setting(178, 1, 5.0, -1), setting(205, -90.0), setting(206, 20.0, 0, 1))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write(MISSION, "fly.plan")


def write(mission: Mission, name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        files.write_mission(mission, name)


def resume(*words: object) -> Result:
    return CliRunner().invoke(main, ["resume", *map(str, words)])


@pytest.mark.parametrize("source", files.FORMATS)
@pytest.mark.parametrize("target", files.FORMATS)
def test_any_format_is_resumed_as_any_format(source: str, target: str) -> None:
    write(MISSION, f"in{source}")
    place = "47.0020,8.0"
    result = resume(f"in{source}", "--from", place, "-o", f"out{target}")
    assert result.exit_code == 0, result.output
    assert result.stdout == ""
    first, rest = read_mission(f"in{source}"), read_mission(f"out{target}")
    assert 0 < rest.estimate.photographs < first.estimate.photographs
    assert "lies 0.0 m from the path" in result.stderr and "the flight goes on at 47.00" in result.stderr


def test_the_rest_is_the_same_bytes_each_time() -> None:
    for name in ("a.plan", "b.plan"):
        assert resume("fly.plan", "--from", "6.5", "-o", name, "-q").output == ""
    assert Path("a.plan").read_bytes() == Path("b.plan").read_bytes()


def test_a_log_is_named_like_any_file() -> None:
    events: list[Any] = [("MODE", {"ModeNum": 3}), ("MISE", {"CNum": 6})]
    places = [(47.0020 + k * 1e-5, 8.0) for k in range(5)]
    events += [(name, {"Lat": lat, "Lng": lon}) for lat, lon in places for name in ("POS", "CAM")]
    Path("12").write_bytes(dataflash(events))  # a file with the name of a number is a file
    result = resume("fly.plan", "--from", "12", "-o", "rest.plan")
    assert result.exit_code == 0, result.output
    assert "12: its last photograph is at 47.0020400,8.0000000" in result.stderr
    document = json.loads(Path("rest.plan").read_text())
    placed = [item["params"][4:6] for item in document["mission"]["items"] if item["command"] == 16]
    assert [pytest.approx(47.00204, abs=1e-7), pytest.approx(8.0, abs=1e-7)] in placed


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("fly.plan --from 90 -o rest.plan", 1, "there is no item 90: the vehicle counts items 1 to 9"),
        ("fly.plan --from 9 -o rest.plan", 1, "nothing is left of the mission"),
        ("fly.plan --from 3.5 -o rest.plan", 1, "is not flown to, so 3.5 is no share of a leg; give 3"),
        ("fly.plan --from here.bin -o rest.plan", 1, "there is no file here.bin"),
        ("fly.plan --from fly.plan -o rest.plan", 1, "fly.plan is not a flight log; expected a .bin of Ardu"),
        ("fly.plan --from 48,8 -o rest.plan", 1, "at most 100 m are taken for a place on it"),
        ("fly.plan --from 1,2,3 -o rest.plan", 1, "--from is LAT,LON in degrees, an item or a log"),
        ("fly.plan --from 6.5 -o rest.txt", 1, "a mission is written as .plan"),
        ("no.plan --from 6.5 -o rest.plan", 1, "there is no file no.plan"),
        ("fly.plan --from 6.5 -o fly.plan", 1, "fly.plan"),
        ("fly.plan --from 6.5 -o fly.plan --overwrite", 1, "fly.plan"),
        ("fly.plan --from 6.5 -o rest.plan --turn through", 1, "--turn is for a .kmz, not for a .plan"),
        ("fly.plan -o rest.plan", 2, "Missing option '--from'"),
        ("fly.plan --from 6.5", 2, "Missing option '-o'"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(words: str, code: int, message: str) -> None:
    before = {path.name: path.read_bytes() for path in Path().iterdir()}
    result = resume(*words.split())
    assert result.exit_code == code, result.output
    assert message in result.stderr.splitlines()[-1]
    assert {path.name: path.read_bytes() for path in Path().iterdir()} == before


def test_a_rest_that_is_there_is_replaced_only_on_request() -> None:
    Path("rest.plan").write_text("mine")
    assert resume("fly.plan", "--from", "6.5", "-o", "rest.plan").exit_code == 1
    assert Path("rest.plan").read_text() == "mine"
    assert resume("fly.plan", "--from", "6.5", "-o", "rest.plan", "--overwrite").exit_code == 0
    assert read_mission("rest.plan").items
