"""Export of the options that the dialogs of QGIS show: `python docs/qgis_options.py`.

The plugin runs in QGIS's own Python, where uavseg is not, so it reads `qgis_uavseg/options.json`, which this
writes from the table of options: those that have a label.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uavseg.jobs.match.request import WINDOWS
from uavseg.options.flights import MissionOptions, PlanOptions
from uavseg.options.maps import ClassifyOptions, PathOptions
from uavseg.options.missions import CheckOptions, FootprintsOptions, GeoreferenceOptions
from uavseg.options.option import Option, options_of
from uavseg.options.regions import ExtractOptions, LevelsOptions, MatchOptions, SuggestOptions
from uavseg.raster.spectral.formula import INDICES

TARGET = Path(__file__).parents[1] / "qgis_uavseg" / "options.json"
JOBS = {
    "extract": ExtractOptions,
    "levels": LevelsOptions,
    "match": MatchOptions,
    "suggest": SuggestOptions,
    "classify": ClassifyOptions,
    "path": PathOptions,
    "plan": PlanOptions,
    "check": CheckOptions,
    "footprints": FootprintsOptions,
    "georeference": GeoreferenceOptions,
}
NAMES = {  # of parameters, where they differ
    ("extract", "classes"): "CLASSES_FILE",
    ("classify", "allow_lost_obstacles"): "ALLOW_LOST",
    "expr": "EXPRESSION",
}
CHOICES = {  # of options that take any text, in a dialog
    ("match", "window"): [str(side) for side in WINDOWS],
    ("suggest", "classes"): list("2345678"),
    "index": list(INDICES),
}


def table() -> dict[str, dict[str, dict[str, Any]]]:
    """Return the options of the dialogs, by command and name of the parameter."""
    return {
        command: {
            NAMES.get((command, name)) or NAMES.get(name) or name.upper(): _described(command, name, options)
            for name, one in options.items()
            if one.label and not (job is ExtractOptions and name in options_of(MissionOptions))
        }
        for command, job in JOBS.items()
        for options in [options_of(job)]
    }


def text() -> str:
    """Return the contents of the file: a line for each option."""
    commands = (
        f"{json.dumps(command)}: {{\n"
        + ",\n".join(
            f"  {json.dumps(name)}: {json.dumps(one, ensure_ascii=False)}" for name, one in options.items()
        )
        + "\n}"
        for command, options in table().items()
    )
    return "{\n" + ",\n".join(commands) + "\n}\n"


def _described(command: str, name: str, options: Mapping[str, Option]) -> dict[str, Any]:
    one = options[name]
    choices = CHOICES.get((command, name)) or CHOICES.get(name) or list(one.choices)
    described = {
        "flag": next(flag for flag in (*one.flags, f"--{name.replace('_', '-')}") if flag.startswith("--")),
        "kind": "choice" if choices else _kind(one),
        "basic": one.basic,
        "label": one.label,
        "help": _help(one, {f"--{key.replace('_', '-')}": other.label for key, other in options.items()}),
    }
    return {**described, "choices": choices} if choices else described


def _kind(one: Option) -> str:
    if one.type is bool:
        return "switch"
    if one.metavar.startswith("FILE") and "|" not in one.metavar:
        return "file"
    if one.type is int:
        return "integer"
    if one.type is float and "|" not in one.metavar:
        return "metres" if one.metavar in ("M", "METRES") else "number"
    return "text"


def _help(one: Option, labels: Mapping[str, str]) -> str:
    """Return the help in the words of a dialog: labels for flags, and what an empty field means."""
    words = re.sub(r"[;.] (May|may) be (given several times|repeated)(, for a mosaic)?\.", ".", one.help)
    words = re.sub(r"\s+\[(default: )?(.*)\]$", r" Empty: \2.", words)
    default = f"{one.default:g}" if isinstance(one.default, float) else str(one.default or "")
    default = one.shown.strip("-") or ("" if isinstance(one.default, tuple | bool) else default)
    words = f"{words} Empty: {default}." if default and " Empty: " not in words else words
    return re.sub(r"--[a-z-]+", lambda flag: f"'{labels.get(flag[0]) or flag[0][2:]}'", words)


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
