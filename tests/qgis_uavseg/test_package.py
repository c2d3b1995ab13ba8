"""The zip of the plugin: what it holds, and what is refused."""

import ast
import configparser
import re
import sys
import zipfile
from pathlib import Path

import pytest

from qgis_uavseg import package
from uavseg import __version__
from uavseg.raster.spectral.indices import INDICES

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
    assert {"qgis_uavseg/__init__.py", "qgis_uavseg/icon.svg", "qgis_uavseg/algorithms/plan.py"} <= set(names)
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
    ],
)
def test_what_the_repository_would_refuse_is_refused_here(
    values: dict[str, str], words: str, tmp_path: Path
) -> None:
    with pytest.raises(package.PackageError, match=words):
        package.write(tmp_path, values)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["lib.so", ".hidden.py", "model.onnx"])
def test_files_that_are_not_text_are_refused(name: str) -> None:
    files = dict(package.contents(LINKS))
    plain = {path.removeprefix("qgis_uavseg/"): data for path, data in files.items()}
    with pytest.raises(package.PackageError, match=re.escape(name)):
        package.check({**plain, name: b"x"})


def test_the_version_is_that_of_uavseg() -> None:
    assert f"\nversion={__version__}\n" in (FOLDER / "metadata.txt").read_text(encoding="utf-8")


def test_the_plugin_imports_qgis_and_the_standard_library_alone() -> None:
    found = set()
    for path in FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), feature_version=(3, 9))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            if isinstance(node, ast.ImportFrom) and not node.level:
                found.add(str(node.module).split(".")[0])
    assert found - set(sys.stdlib_module_names) == {"qgis"}


def test_the_indices_are_those_of_uavseg() -> None:
    tree = ast.parse((FOLDER / "reading.py").read_text(encoding="utf-8"))
    assigned = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    assert set(ast.literal_eval(assigned["INDICES"])) == set(INDICES)
