"""QGIS headless: `qgis_process` with the plugin of this repository and a profile of its own."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(sys.executable).with_name("uavseg")
QGIS = shutil.which("qgis_process.bin") or shutil.which(
    "qgis_process"
)  # Debian's script adds what QGIS refuses


@dataclass(frozen=True)
class Answer:
    """How qgis_process ended."""

    code: int
    results: dict[str, Any]
    log: str


@dataclass(frozen=True)
class Headless:
    """QGIS without a screen, and the program that its algorithms run."""

    environment: dict[str, str]
    program: Path

    def run(self, algorithm: str, **parameters: object) -> Answer:
        """Run an algorithm of the provider; parameters may be lists."""
        words = [
            f"{name}={value}"
            for name, given in parameters.items()
            for value in (given if isinstance(given, list) else [given])
        ]
        done = self.call("--json", "run", f"uavseg:{algorithm}", "--", *words)
        found = json.loads(done.stdout) if done.stdout.startswith("{") else {}
        return Answer(
            done.returncode, found.get("results", {}), json.dumps(found.get("log", {})) + done.stderr
        )

    def call(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run qgis_process."""
        assert QGIS is not None
        return subprocess.run(
            [QGIS, *words], env=self.environment, capture_output=True, text=True, timeout=300, check=False
        )

    def typed(self, *words: object, code: int = 0) -> str:
        """What the command line prints on stdout; in this process, where it is of the same package."""
        line = list(map(str, words))
        if self.program == HERE:
            from click.testing import CliRunner  # QGIS's own Python, where `inside` runs, has neither

            from uavseg.cli import main

            result = CliRunner().invoke(main, line)
            assert result.exit_code == code, result.output
            return result.stdout
        done = subprocess.run([self.program, *line], capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == code, done.stderr
        return done.stdout


def _environment(folder: Path, program: Path) -> dict[str, str]:
    runtime = folder / "run"
    runtime.mkdir(mode=0o700)
    own = {
        "QT_QPA_PLATFORM": "offscreen",
        "XDG_RUNTIME_DIR": str(runtime),
        "QGIS_CUSTOM_CONFIG_PATH": str(folder / "profile"),
        "QGIS_PLUGINPATH": str(ROOT),
        "UAVSEG_PROGRAM": str(program),
        # QGIS takes the first python3 on the PATH for its own, which is the system's.
        "PATH": os.pathsep.join(["/usr/bin", "/bin", os.environ.get("PATH", "")]),
        # What QGIS sets on other systems, for libraries of its own; the program must not see it.
        "PROJ_LIB": "/usr/share/proj",
        "PROJ_DATA": "/usr/share/proj",
        "GDAL_DATA": "/usr/share/gdal",
    }
    return {**{name: value for name, value in os.environ.items() if name != "PYTHONPATH"}, **own}


@pytest.fixture(scope="session")
def qgis(tmp_path_factory: pytest.TempPathFactory) -> Headless:
    """QGIS with the plugin enabled; skipped where there is no QGIS, unless UAVSEG_REQUIRE_QGIS is set."""
    if QGIS is None:
        if os.environ.get("UAVSEG_REQUIRE_QGIS"):
            pytest.fail("UAVSEG_REQUIRE_QGIS is set, and there is no qgis_process on the PATH")
        pytest.skip("there is no qgis_process on the PATH")
    program = Path(os.environ.get("UAVSEG_PROGRAM") or HERE)
    headless = Headless(_environment(tmp_path_factory.mktemp("qgis"), program), program)
    enabled = headless.call("plugins", "enable", "qgis_uavseg")
    assert enabled.returncode == 0, enabled.stderr
    return headless
