"""`uavseg upload` and `uavseg download`: files, exit codes, reports, progress."""

import json
import os
import signal
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import uavseg
from tests.flight.link.link_missions import fenced, survey
from tests.flight.link.served import LOOPBACK, udp_vehicle
from tests.flight.link.vehicles import ArduPilot, Generic, Px4
from uavseg.cli import main
from uavseg.flight.formats import files
from uavseg.flight.link import link


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "LISTEN_S", 0.05)


def run(*words: object) -> Result:
    return CliRunner().invoke(main, [*map(str, words)])


@pytest.mark.slow
def test_a_mission_goes_to_the_vehicle_and_comes_back(tmp_path: Path) -> None:
    plan, back = tmp_path / "fly.plan", tmp_path / "back.plan"
    files.write_mission(fenced(survey()), plan)
    vehicle = ArduPilot()
    with udp_vehicle(vehicle) as address:
        sent = run("upload", plan, "--connect", address, "--progress", "plain")
        assert (sent.exit_code, sent.stdout) == (0, "")
        assert f"{plan}: 12 items, a fence of 3 shapes, 2 rally points (ArduPilot, system 1)" in sent.stderr
        assert "read back and equal" in sent.stderr
        percents = [line for line in sent.stderr.splitlines() if line.startswith("progress ")]
        assert percents[-1] == "progress 100" and len(percents) > 10
        found = run("download", "--connect", address, "-o", back)
        assert (found.exit_code, found.stdout) == (0, "")
        assert f"{back}: 12 items, a fence of 3 shapes, 2 rally points (ArduPilot, system 1)" in found.stderr
        kept = back.read_bytes()
        again = run("download", "--connect", address, "-o", back)
        assert again.exit_code == 1 and "--overwrite" in again.stderr and back.read_bytes() == kept
        assert run("download", "--connect", address, "-o", back, "--overwrite", "-q").output == ""
    assert files.read_mission(back).fence == fenced(survey()).fence
    assert [row["command"] for row in json.loads(kept)["mission"]["items"]] == [
        item.command for item in survey().items
    ]


@pytest.mark.slow
def test_verbose_says_how_long_the_parts_of_a_transfer_took(tmp_path: Path) -> None:
    plan, back = tmp_path / "fly.plan", tmp_path / "back.plan"
    files.write_mission(fenced(survey()), plan)
    with udp_vehicle(ArduPilot()) as address:
        sent = run("upload", plan, "--connect", address, "-v").stderr
        found = run("download", "--connect", address, "-o", back, "-v").stderr
        silent = run("download", "--connect", address, "-o", back, "--overwrite", "-v", "-q").output
    for text, part in ((sent, "upload and comparison"), (found, "download")):
        said = [line for line in text.splitlines() if line.startswith("uavseg: ")]
        assert [line.rpartition(": ")[0] for line in said if "phase" in line] == [
            "uavseg: phase connection",
            f"uavseg: phase {part}",
        ]
        assert f"uavseg: ArduPilot, system 1 at {address}" in said
    assert silent == ""


@pytest.mark.slow
def test_a_waypoints_file_without_the_fence_says_so(tmp_path: Path) -> None:
    vehicle = ArduPilot()
    with udp_vehicle(vehicle) as address:
        uavseg.upload(fenced(survey()), connect=address)
        done = run("download", "--connect", address, "-o", tmp_path / "held.waypoints")
    assert done.exit_code == 0 and "uavseg: warning: a .waypoints file cannot hold a fence" in done.stderr


@pytest.mark.slow
def test_a_refusal_ends_with_1_and_names_the_item(tmp_path: Path) -> None:
    plan = tmp_path / "fly.plan"
    files.write_mission(survey(), plan)
    vehicle = ArduPilot()
    vehicle.refused = {5: 3}
    with udp_vehicle(vehicle) as address:
        done = run("upload", plan, "--connect", address)
    assert (done.exit_code, done.stdout) == (1, "")
    assert done.stderr.startswith("uavseg: error: the vehicle refuses item 5 of the mission, NAV_")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_mission_that_cannot_be_read_back_ends_with_3(tmp_path: Path) -> None:
    plan = tmp_path / "fly.plan"
    files.write_mission(survey(autopilot="px4"), plan)
    vehicle = Px4()
    vehicle.silent_after = 13  # the count and the items
    with udp_vehicle(vehicle) as address:
        done = run("upload", plan, "--connect", address, "--timeout", "1")
    assert done.exit_code == 3
    assert done.stderr.startswith("uavseg: error: the vehicle accepted the mission, but it could not be read")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["missing.plan", "--connect", "udpout:a:1"], "no file missing.plan"),
        (["fly.kml", "--connect", "udpout:a:1"], ".plan and .waypoints"),
        (["fly.plan", "--connect", "usb0"], "a vehicle's address is udpout:HOST:PORT"),
        (["fly.plan", "--connect", "udpout:a:1", "--timeout", "0"], "timeout"),
        (["fly.plan", "--connect", "udpout:a:1", "--timeout", "nan"], "timeout"),
    ],
)
def test_wrong_words_are_one_line_before_anything_is_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    files.write_mission(survey(), "fly.plan")
    done = run("upload", *words)
    assert done.exit_code == 1 and done.stderr.startswith("uavseg: error: ") and said in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("words", [["upload"], ["upload", "fly.plan"], ["download", "--connect", "tcp:a:1"]])
def test_missing_words_are_wrong_usage(words: list[str]) -> None:
    assert run(*words).exit_code == 2


def test_a_download_checks_its_file_first(tmp_path: Path) -> None:
    for name in ("held.kml", "none/held.plan"):
        done = run("download", "--connect", "udpout:a:1", "-o", tmp_path / name)
        assert done.exit_code == 1 and not list(tmp_path.iterdir())


def test_a_failed_download_leaves_no_file(tmp_path: Path) -> None:
    with udp_vehicle(Generic()) as address:
        done = run("download", "--connect", address, "-o", tmp_path / "held.plan")
    assert done.exit_code == 1 and done.stderr == "uavseg: error: the vehicle holds no mission\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_warnings_are_printed_and_quiet_hides_them(tmp_path: Path) -> None:
    plan = tmp_path / "fly.plan"
    high = [replace(item, altitude_m=150.0) if item.has_position else item for item in survey().items]
    files.write_mission(replace(survey(), items=tuple(high)), plan)
    with udp_vehicle(ArduPilot(armed=True)) as address:
        done = run("upload", plan, "--connect", address, "--while-armed")
        assert "uavseg: warning: 150 m above home" in done.stderr
        assert "uavseg: warning: the vehicle is armed" in done.stderr
        assert run("upload", plan, "--connect", address, "--while-armed", "-q").output == ""


def test_an_armed_vehicle_is_an_error_of_one_line(tmp_path: Path) -> None:
    files.write_mission(survey(), tmp_path / "fly.plan")
    vehicle = ArduPilot(armed=True)
    with udp_vehicle(vehicle) as address:
        done = run("upload", tmp_path / "fly.plan", "--connect", address)
    assert done.exit_code == 1 and done.stderr.startswith("uavseg: error: the vehicle is armed and may be")
    assert done.stderr.count("\n") == 1 and vehicle.seen == {"HEARTBEAT"}


@pytest.mark.slow
@pytest.mark.parametrize("job", ["upload", "download"])
def test_an_interrupted_command_ends_with_130(tmp_path: Path, job: str) -> None:
    plan = tmp_path / "fly.plan"
    files.write_mission(survey(), plan)
    words = [str(plan)] if job == "upload" else ["-o", str(tmp_path / "held.plan")]
    how = os.environ | {"PYTHONPATH": str(Path(uavseg.__file__).parents[1])}
    with socket.create_server((LOOPBACK, 0)) as silent:
        address = f"tcp:{LOOPBACK}:{silent.getsockname()[1]}"
        ran = subprocess.Popen(
            [sys.executable, "-m", "uavseg", job, *words, "--connect", address, "--timeout", "600"],
            stderr=subprocess.PIPE,
            text=True,
            env=how,
        )
        silent.settimeout(60)
        connection, _ = silent.accept()
        ran.send_signal(signal.SIGINT)
        _, said = ran.communicate(timeout=60)
        connection.close()
    assert ran.returncode == 130
    what = "the mission of the vehicle may be incomplete" if job == "upload" else "nothing was written"
    assert said == f"uavseg: interrupted; {what}\n"
