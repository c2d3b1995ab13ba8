"""The zip of the plugin: what it holds, and what is refused."""

import ast
import configparser
import json
import re
import sys
import zipfile
from pathlib import Path

import pytest

from qgis_uavseg import package
from uavseg import __version__
from uavseg.raster.spectral.formula import INDICES

FOLDER = Path(package.__file__).resolve().parent
LINKS = {
    "homepage": "https://example.org",
    "repository": "https://example.org/r",
    "tracker": "https://example.org/t",
    "email": "a@example.org",
}


def test_the_zip_is_one_folder_with_licence_and_complete_metadata(tmp_path: Path) -> None:
    path = package.write(tmp_path, LINKS)
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        metadata = configparser.ConfigParser(interpolation=None)
        metadata.read_string(archive.read("qgis_uavseg/metadata.txt").decode("utf-8"))
        assert "MIT License" in archive.read("qgis_uavseg/LICENSE").decode("utf-8")
    assert {name.split("/")[0] for name in names} == {"qgis_uavseg"}
    assert {
        "qgis_uavseg/__init__.py",
        "qgis_uavseg/icon.svg",
        "qgis_uavseg/algorithms/plan.py",
        "qgis_uavseg/dock/finder.py",
    } <= set(names)
    assert not [name for name in names if re.search(r"__pycache__|\.pyc|/\.|package\.py|tests", name)]
    assert metadata["general"]["homepage"] == "https://example.org"
    assert path.stat().st_size < 1_000_000


def test_the_zip_holds_the_same_bytes_each_time(tmp_path: Path) -> None:
    one, other = package.write(tmp_path / "a", LINKS), package.write(tmp_path / "b", LINKS)
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, "homepage is empty"),
        ({**LINKS, "tracker": "example.org"}, "tracker is 'example.org', not an address"),
        ({**LINKS, "icon": "none.svg"}, "the icon 'none.svg' is not there"),
        ({**LINKS, "about": "100 % tested"}, "metadata.txt cannot be read: '%' must be followed"),
        ({**LINKS, "experimental": "perhaps"}, "experimental is 'perhaps', not True or False"),
        ({**LINKS, "qgisMinimumVersion": "new"}, "qgisMinimumVersion is 'new'"),
        ({**LINKS, "author": "a/b"}, "author has a /"),
    ],
)
def test_what_the_repository_would_refuse_is_refused_here(
    values: dict[str, str], words: str, tmp_path: Path
) -> None:
    with pytest.raises(package.PackageError, match=words):
        package.write(tmp_path, values)
    assert not list(tmp_path.iterdir())


URLS = """
[project]
authors = [{ name = "A. Author" }, { name = "B. Author", email = "b@example.org" }]
[project.urls]
Homepage = "https://example.org"
"Source Code" = "https://example.org/r"
"bug-tracker" = "https://example.org/t"
"""
FROM_URLS = {**LINKS, "email": "b@example.org", "author": "A. Author, B. Author"}


@pytest.fixture
def pyproject(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "pyproject.toml"
    path.write_text(URLS, encoding="utf-8")
    monkeypatch.setattr(package, "PYPROJECT", path)
    return path


def _metadata(folder: Path) -> dict[str, str]:
    (path,) = folder.glob("*.zip")
    found = configparser.ConfigParser(interpolation=None)
    with zipfile.ZipFile(path) as archive:
        found.read_string(archive.read("qgis_uavseg/metadata.txt").decode("utf-8"))
    return {key: found["general"][key] for key in FROM_URLS}


def test_links_and_authors_are_those_of_the_project(pyproject: Path, tmp_path: Path) -> None:
    assert package.project_metadata(pyproject) == FROM_URLS
    assert package.main(["-o", str(tmp_path / "zip")]) == 0
    assert _metadata(tmp_path / "zip") == FROM_URLS


@pytest.mark.parametrize("name", LINKS)
def test_an_option_takes_the_place_of_what_the_project_has(
    name: str, pyproject: Path, tmp_path: Path
) -> None:
    other = "c@example.org" if name == "email" else "https://example.net"
    assert package.main(["-o", str(tmp_path / "zip"), f"--{name}", other]) == 0
    assert _metadata(tmp_path / "zip") == {**FROM_URLS, name: other}


@pytest.mark.parametrize(
    ("lines", "names", "places"),
    [
        ([3, 4, 5], "homepage, repository, tracker", "Homepage, Repository, Issues under [project.urls]"),
        ([5], "tracker", "Issues under [project.urls]"),
        ([1], "email", "an email in authors of [project]"),
        ([1, 4], "repository, email", "Repository under [project.urls] and an email in authors of [project]"),
    ],
)
def test_what_the_project_does_not_have_is_refused_with_where_to_write_it(
    lines: list[int],
    names: str,
    places: str,
    pyproject: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    kept = [line for k, line in enumerate(URLS.strip().splitlines()) if k not in lines]
    pyproject.write_text("\n".join(kept), encoding="utf-8")
    assert package.main(["-o", str(tmp_path / "zip")]) == 1
    options = ", ".join(f"--{name}" for name in names.split(", "))
    assert capsys.readouterr() == (
        "",
        f"qgis_uavseg: error: the repository of QGIS requires {names}: write {places} in {pyproject}, or "
        f"give {options}\n",
    )
    assert not (tmp_path / "zip").exists()
    given = [word for name in names.split(", ") for word in (f"--{name}", LINKS[name])]
    assert package.main(["-o", str(tmp_path / "zip"), *given]) == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "No such file"),
        ("[project", "Expected ']'"),
        ("[project]\nurls = 3", "[project.urls] is 3, not a table"),
        ("[project]\nurls = { Homepage = 3 }", "Homepage is 3, not a text"),
        ("[project]\nauthors = [3]", "an author is 3, not a table"),
        ('[project]\nauthors = [{ name = "a\\nicon=x" }]', "is 'a\\nicon=x', not one line of text"),
        ('[project.urls]\nHomepage = "example.org"', "homepage is 'example.org', not an address"),
    ],
)
def test_a_project_that_cannot_be_read_is_one_line(
    text: str | None, words: str, pyproject: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pyproject.unlink()
    if text is not None:
        pyproject.write_text(text, encoding="utf-8")
    options = [word for name in LINKS if name != "homepage" for word in (f"--{name}", LINKS[name])]
    options += [] if text and "Homepage" in text else ["--homepage", LINKS["homepage"]]
    assert package.main(["-o", str(tmp_path / "zip"), *options]) == 1
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
    assert not (tmp_path / "zip").exists()


@pytest.mark.parametrize("name", ["../above.py", "lib.so", ".hidden.py", "model.onnx"])
def test_files_that_are_not_text_are_refused(name: str) -> None:
    files = dict(package.contents(LINKS))
    plain = {path.removeprefix("qgis_uavseg/"): data for path, data in files.items()}
    with pytest.raises(package.PackageError, match=re.escape(name)):
        package.check({**plain, name: b"x"})


def test_what_must_be_there_is_there() -> None:
    plain = {path.removeprefix("qgis_uavseg/"): data for path, data in package.contents(LINKS)}
    for name in ("__init__.py", "LICENSE"):
        with pytest.raises(package.PackageError, match=rf"{name}: is not there"):
            package.check({path: data for path, data in plain.items() if path != name})
    with pytest.raises(package.PackageError, match="more than 25,000,000 bytes"):
        package.check({**plain, "long.txt": b" " * 25_000_000})


def test_the_version_is_that_of_uavseg() -> None:
    assert f"\nversion={__version__}\n" in (FOLDER / "metadata.txt").read_text(encoding="utf-8")


def test_the_plugin_imports_qgis_and_the_standard_library_alone() -> None:
    """Numpy, which comes with QGIS, draws cells in the dock, and nowhere else."""
    assert _imported([FOLDER / "dock" / "block_means.py"]) == {"qgis", "numpy"}
    others = [path for path in FOLDER.rglob("*.py") if path.name != "block_means.py"]
    assert _imported(others) == {"qgis", "processing"}  # the second is of QGIS


def _imported(paths: list[Path]) -> set[str]:
    found = set()
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), feature_version=(3, 9))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            if isinstance(node, ast.ImportFrom) and not node.level:
                found.add(str(node.module).split(".")[0])
    return found - set(sys.stdlib_module_names)


def test_the_indices_are_those_of_uavseg() -> None:
    table = json.loads((FOLDER / "options.json").read_text(encoding="utf-8"))
    assert set(table["extract"]["INDEX"]["choices"]) == set(INDICES)
