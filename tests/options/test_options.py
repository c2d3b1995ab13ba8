"""The description of each option is the only one: signatures, docstrings, help and defaults agree with it."""

import importlib.util
import inspect
import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

import uavseg
from uavseg.cli import main
from uavseg.options import flights, maps, missions, pages, regions
from uavseg.options.option import arguments_of, build, group, option, options_of

JOBS: dict[str, type] = {
    "extract": regions.ExtractOptions,
    "levels": regions.LevelsOptions,
    "match": regions.MatchOptions,
    "suggest": regions.SuggestOptions,
    "compare": regions.CompareOptions,
    "divide": regions.DivideOptions,
    "original": regions.OriginalOptions,
    "info": regions.InfoOptions,
    "plan": flights.PlanOptions,
    "check": missions.CheckOptions,
    "resume": missions.ResumeOptions,
    "upload": missions.UploadOptions,
    "download": missions.DownloadOptions,
    "footprints": missions.FootprintsOptions,
    "georeference": missions.GeoreferenceOptions,
    "classify": maps.ClassifyOptions,
    "path": maps.PathOptions,
    "describe": maps.DescribeOptions,
    "recognise": maps.RecogniseOptions,
    "next-view": maps.NextViewOptions,
    "explore": maps.ExploreOptions,
    "build-map": maps.BuildMapOptions,
    "merge-maps": maps.MergeMapsOptions,
    "mask": maps.MaskOptions,
    "simulate": maps.SimulateOptions,
    "preview": pages.PreviewOptions,
    "map": pages.MapOptions,
    "serve": pages.ServeOptions,
    "cameras": pages.CamerasOptions,
    "doctor": pages.DoctorOptions,
    "warm-up": pages.WarmUpOptions,
}
FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(uavseg, name) for name in ("extract", "levels", "match", "suggest", "divide", "info")},
    **{name: getattr(uavseg, name) for name in ("plan", "check", "resume", "upload", "download")},
    **{name: getattr(uavseg, name) for name in ("classify", "path")},
    "compare": uavseg.compare,
    "next-view": uavseg.next_views,
    "explore": uavseg.explore,
    "build-map": uavseg.build_map,
    "footprints": uavseg.footprints,
    "georeference": uavseg.georeference,
    "describe": uavseg.describe,
    "recognise": uavseg.recognise,
    "merge-maps": uavseg.merge_maps,
    "mask": uavseg.mask,
    "preview": uavseg.preview,
    "map": uavseg.map_page,
    "serve": uavseg.serve,
}
OF_PYTHON = {
    "source",
    "before",
    "after",
    "scene",
    "progress",
    "regions",
    "photographs",
    "mission",
    "bag",
    "maps",
    "output",
}  # not of the command line


def command(name: str) -> click.Command:
    found = main.get_command(click.Context(main), name)
    assert found is not None
    return found


def python_options(name: str) -> dict[str, Any]:
    return {key: one for key, one in options_of(JOBS[name]).items() if one.python}


def test_every_command_has_options() -> None:
    assert set(JOBS) == set(main.list_commands(click.Context(main)))
    assert all(command(name).job is JOBS[name] for name in JOBS)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_signature_has_the_options_of_its_job_and_their_defaults(name: str) -> None:
    parameters = inspect.signature(FUNCTIONS[name]).parameters
    described = python_options(name)
    assert set(parameters) - OF_PYTHON == set(described) - OF_PYTHON
    for key, one in described.items():
        given = parameters[key].default
        assert one.required or key in ("home", "range") or given == one.default, key
        assert not one.required or given is inspect.Parameter.empty, key


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_docstring_names_every_option(name: str) -> None:
    text = inspect.getdoc(FUNCTIONS[name]) or ""
    section = re.split(r"\n\n(?=\w+\n---)", text.split("Parameters\n----------\n")[1])[0]
    heads = " ".join(line for line in section.split("\n") if not line.startswith(" "))
    named = set(re.findall(r"\w+", heads))
    known = set(python_options(name))
    if "..." in heads:  # "band, ..., allow_network", as of `extract`
        known -= set(python_options("extract"))
    assert known <= named, known - named


@pytest.mark.parametrize("name", JOBS)
def test_flags_follow_from_names(name: str) -> None:
    for parameter in command(name).params:
        if isinstance(parameter, click.Option) and parameter.name in options_of(JOBS[name]):
            dashed = f"--{str(parameter.name).replace('_', '-')}"
            flags = options_of(JOBS[name])[str(parameter.name)].flags
            assert flags or dashed in parameter.opts


@pytest.mark.parametrize("name", JOBS)
def test_help_is_short_and_help_all_has_every_option(name: str) -> None:
    short = CliRunner().invoke(main, [name, "--help"], terminal_width=100)
    full = CliRunner().invoke(main, [name, "--help-all"], terminal_width=100)
    assert short.exit_code == full.exit_code == 0
    listed = short.output.partition("\nOptions:\n")[2].partition("\n\n")[0].splitlines()
    assert len(listed) <= 25, "\n".join(listed)
    flat = " ".join(full.output.split())
    for key, one in options_of(JOBS[name]).items():
        assert (one.flags[-1] if one.flags else f"--{key.replace('_', '-')}").split("/")[0] in full.output
        assert " ".join(one.help.split("  [")[0].split()) in flat, key


@pytest.mark.parametrize("name", JOBS)
def test_what_is_not_given_has_its_default(name: str) -> None:
    made = build(JOBS[name], {})
    values = flat(made)
    for key, one in options_of(JOBS[name]).items():
        if key not in ("nodata", "flatten", "stretch"):  # parsed when they are made
            assert values[key] == one.default, key


def flat(made: Any) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for one in fields(made):
        value = getattr(made, one.name)
        found |= flat(value) if "group" in one.metadata else {one.name: value}
    return found


def test_a_group_may_leave_out_and_change_options() -> None:
    assert "fill_holes" not in options_of(regions.LevelsOptions)
    assert options_of(missions.CheckOptions)["max_altitude"].default is None
    assert options_of(flights.PlanOptions)["max_altitude"].default == 120
    assert build(missions.CheckOptions, {}).safety.max_altitude is None
    assert build(missions.CheckOptions, {"fence": 3}).safety.fence == 50  # an option that it does not have


def test_values_reach_their_groups() -> None:
    made = build(regions.ExtractOptions, {"rasters": ("a.tif",), "band": 3, "simplify": 1.5, "dem": "d.tif"})
    assert made.source.rasters == ("a.tif",) and made.read.band == 3
    assert made.drawing.simplify == 1.5 and made.flight.terrain.dem == "d.tif"
    assert arguments_of(regions.ExtractOptions).keys() == {"rasters"} and is_dataclass(made)
    assert option("a").metadata["option"].help == "a"
    assert group(regions.SizeOptions).metadata["group"].of is regions.SizeOptions


@pytest.mark.parametrize("name", JOBS)
def test_no_name_is_described_twice(name: str) -> None:
    names = [str(one.name) for one in command(name).params]
    assert len(names) == len(set(names))


def test_the_dialogs_of_qgis_have_the_options_of_the_table() -> None:
    """The plugin reads a file, since it cannot import uavseg; `python docs/qgis_options.py` writes it."""
    path = Path(__file__).parents[2] / "docs" / "qgis_options.py"
    specification = importlib.util.spec_from_file_location("qgis_options", path)
    assert specification is not None and specification.loader is not None
    exporter = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(exporter)
    assert exporter.TARGET.read_text(encoding="utf-8") == exporter.text()
