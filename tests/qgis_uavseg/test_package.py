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
