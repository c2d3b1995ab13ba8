"""QGIS on this machine: where it is found, and its version."""

import os
import shutil
import subprocess
import tempfile

_PROGRAMS = ("qgis_process.bin", "qgis_process", "qgis_process-qgis.bat", "qgis_process-qgis-ltr.bat")
_KEPT = ("PATH", "LANG", "SYSTEMROOT")  # other variables may name libraries of Python's
_FOLDERS = ("HOME", "XDG_RUNTIME_DIR", "QGIS_CUSTOM_CONFIG_PATH", "TEMP", "TMP")  # that QGIS may write to
_TIMEOUT_S = 20.0


def find_qgis() -> str:
    """Return the version of the QGIS on the search path, such as "3.22.16-Białowieża"; empty where none is.

    It is started to ask for its version, without the variables of this environment.
    """
    found = [program for program in _PROGRAMS if shutil.which(program)]
    for program in found:
        version = _version(program)
        if version:
            return version
    if found or shutil.which("qgis"):
        return "found, but it does not say its version"
    return ""


def _version(program: str) -> str:
    """Return what a program says in the line that begins with "QGIS"."""
    with tempfile.TemporaryDirectory(prefix="uavseg-") as folder:
        kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
        own = {"QT_QPA_PLATFORM": "offscreen"} | dict.fromkeys(_FOLDERS, folder)
        try:
            answer = subprocess.run(
                [shutil.which(program) or program, "--version"],
                capture_output=True,
                timeout=_TIMEOUT_S,
                check=False,
                env=kept | own,
                stdin=subprocess.DEVNULL,
            )
        except (OSError, subprocess.TimeoutExpired):  # then it says nothing of itself
            return ""
    lines = answer.stdout.decode("utf-8", "replace").splitlines()
    said = next((line for line in lines if line.startswith("QGIS ")), "")
    return said.removeprefix("QGIS ").split(" '")[0].strip()
