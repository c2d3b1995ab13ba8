"""Packaging: what the recipe, the container and the source distribution say follows pyproject.toml."""

import importlib.util
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

import uavseg

ROOT = Path(__file__).resolve().parents[1]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RECIPE: dict[str, Any] = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text())
CONDA_NAMES = {"matplotlib": "matplotlib-base", "PyYAML": "pyyaml"}


def requirement(text: str) -> tuple[str, str]:
    """Name of a distribution, and its least version."""
    found = re.match(r"([\w.-]+)\s*>=\s*([\w.]+)", text)
    assert found is not None, text
    return CONDA_NAMES.get(found[1], found[1]), found[2]


def test_the_recipe_requires_what_the_project_requires() -> None:
    run = dict(map(requirement, RECIPE["requirements"]["run"]))
    assert run.pop("python") == PROJECT["requires-python"].removeprefix(">=")
    assert run == dict(map(requirement, PROJECT["dependencies"]))


def test_the_recipe_has_the_version_program_and_licence_of_the_project() -> None:
    assert RECIPE["context"]["version"] == uavseg.__version__
    [program] = RECIPE["build"]["python"]["entry_points"]
    assert dict([program.split(" = ")]) == PROJECT["scripts"]
    assert RECIPE["about"]["license"] == PROJECT["license"]
    assert RECIPE["about"]["summary"] == PROJECT["description"]


def test_the_container_copies_files_that_are_there_and_not_ignored() -> None:
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    copied = {
        word
        for line in lines
        if line.startswith("COPY ") and "--from" not in line
        for word in line.split()[1:-1]
    }
    assert "uavseg" in copied and all((ROOT / name).exists() for name in copied)
    kept = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    assert copied == kept


def test_the_container_has_what_wheels_take_from_the_system() -> None:
    """rasterio's wheels link libexpat.so.1 and do not bring it; python:*-slim has none."""
    last = (ROOT / "Dockerfile").read_text().split("\nFROM ")[-1]
    [packages] = re.findall(r"apt-get install --yes --no-install-recommends (.*) \\\n", last)
    assert packages.split() == ["libexpat1"]
    assert last.index("apt-get install") < last.index("RUN pip install") < last.index("RUN uavseg doctor")


def test_the_container_installs_an_extra_that_the_project_has() -> None:
    [extra] = re.findall(r"\.whl\)\[(\w+)\]", (ROOT / "Dockerfile").read_text())
    assert extra in PROJECT["optional-dependencies"]


@pytest.mark.parametrize("named", [PROJECT["readme"], *PROJECT["license-files"][:1]])
def test_files_that_a_build_needs_are_copied_into_the_container(named: str) -> None:
    assert f"!{named}" in (ROOT / ".dockerignore").read_text().splitlines()


def test_what_builds_the_kernels_is_in_the_sdist_and_the_container_but_not_in_the_wheel() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["tool"]["setuptools"]["packages"]["find"]["include"] == ["uavseg*"]
    assert "recursive-include build_kernels *.py" in (ROOT / "MANIFEST.in").read_text().splitlines()
    assert "!build_kernels" in (ROOT / ".dockerignore").read_text().splitlines()
    [module] = re.findall(r'"-m", "([\w.]+)"', (ROOT / "build_backend.py").read_text())
    assert (ROOT / module.replace(".", "/")).with_suffix(".py").exists()


@pytest.mark.parametrize("name", ["tests.yml", "release.yml"])
def test_workflows_run_sessions_that_there_are(name: str) -> None:
    sessions = set(
        re.findall(r"^@nox\.session.*\ndef (\w+)\(", (ROOT / "noxfile.py").read_text(), re.MULTILINE)
    )
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / name).read_text())
    steps = [step for job in workflow["jobs"].values() for step in job["steps"]]
    lines = [step["run"].partition(" -- ")[0] for step in steps if step.get("run", "").startswith("nox -s")]
    called = {word for line in lines for word in line.partition("$")[0].split()[2:]}
    assert called and called <= sessions


def test_only_a_tag_releases_and_no_job_has_more_rights_than_it_needs() -> None:
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text())
    assert workflow[True] == {"push": {"tags": ["v*"]}}  # YAML takes `on` for a truth value
    assert workflow["permissions"] == {}
    written = {name: job.get("permissions") for name, job in workflow["jobs"].items()}
    assert written["pypi"] == {"id-token": "write"}
    assert written["install"] == {} and written["build"] == {"contents": "read"}
    assert {"build", "install"} <= set(workflow["jobs"]["pypi"]["needs"])


@pytest.mark.slow
def test_libraries_make_a_wheel_for_their_platform(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    build_backend = load_backend()
    given: list[Any] = []
    monkeypatch.setattr(build_backend, "_compile_kernels", lambda: None)
    monkeypatch.setattr(build_backend, "__file__", str(tmp_path / "build_backend.py"))
    monkeypatch.setattr(build_backend.build_meta, "build_wheel", lambda *words: given.append(words))
    build_backend.build_wheel("out", {"--build-option": "--quiet"})
    (tmp_path / "uavseg" / "_jit" / "libraries").mkdir(parents=True)
    (tmp_path / "uavseg" / "_jit" / "libraries" / "x86-64.so").touch()
    build_backend.build_wheel("out", {"--build-option": "--quiet"})
    assert [words[1]["--build-option"] for words in given] == [
        "--quiet",
        ["--quiet", "--plat-name", "linux_x86_64"],
    ]


def load_backend() -> Any:
    spec = importlib.util.spec_from_file_location("build_backend", ROOT / "build_backend.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
