"""What preview and check say of a mission reads like what plan said."""

import re
from contextlib import chdir
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from uavseg.cli import main
from uavseg.plot import preview_missions as module

QUARRY = Path(__file__).resolve().parents[2] / "samples" / "quarry.tif"


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".plan", ".waypoints", ".kml"])
@pytest.mark.parametrize("how", [(), ("--pattern", "survey", "--camera", "phantom 4 rtk")])
def test_lengths_and_times_are_those_of_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, how: tuple[str, ...]
) -> None:
    titles: list[str] = []
    known = module.mission_title

    def title(layers: Any) -> list[str]:
        titles.extend(known(layers))
        return known(layers)

    monkeypatch.setattr(module, "mission_title", title)
    words = ["--mission", f"m{suffix}", "--home", "auto", "--altitude", "60", "-o", "q.gpkg", *how]
    with chdir(tmp_path):
        done = CliRunner().invoke(main, ["extract", str(QUARRY), "--range", "0.511,1", *words])
        assert done.exit_code == 0, done.output
        [planned] = re.findall(r"m\.\w+: \d+ regions, (.+ items, .+ km, about .+ s)", done.stderr)
        checked = CliRunner().invoke(main, ["check", f"m{suffix}"])
        assert CliRunner().invoke(main, ["preview", f"m{suffix}", "-o", "m.png"]).exit_code == 0
    assert titles[0].startswith(f"mission of {planned}")
    km, time = planned.split(", ")[1:]
    assert re.search(rf"distance +{km} at", checked.stdout) and re.search(rf"time +{time}\n", checked.stdout)
