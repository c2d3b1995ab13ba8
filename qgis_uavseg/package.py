"""Zip of the plugin for the repository of QGIS: `python -m qgis_uavseg.package -o DIR`.

The names and keys checked are those of the repository's validator: one folder, metadata that are complete, a
LICENSE, no binaries, hidden or compiled files. The zip holds the same bytes each time.
"""

from __future__ import annotations

import argparse
import configparser
import re
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
LICENSE = FOLDER.parent / "LICENSE"
LINKS = ("homepage", "repository", "tracker", "email")
REQUIRED = ("name", "description", "about", "version", "qgisMinimumVersion", "author", *LINKS)
SWITCHES = ("experimental", "deprecated")
LARGEST = 25_000_000
SUFFIXES = frozenset((".py", ".json", ".svg", ".txt", ".qml"))
_OLDEST = (1980, 1, 1, 0, 0, 0)  # that a zip can say


class PackageError(ValueError):
    """The plugin would be refused."""


def contents(metadata: dict[str, str]) -> list[tuple[str, bytes]]:
    """Names in the zip and their bytes, in the order of names.

    Parameters
    ----------
    metadata : dict
        Values that replace those of metadata.txt, such as the homepage.

    Raises
    ------
    PackageError
        If the repository would refuse it.
    """
    files = {"LICENSE": LICENSE.read_bytes()}
    for path in FOLDER.rglob("*"):
        inside = path.relative_to(FOLDER)
        if path.is_file() and "__pycache__" not in inside.parts and path.name != "package.py":
            files[inside.as_posix()] = path.read_bytes()
    files["metadata.txt"] = filled(files["metadata.txt"].decode("utf-8"), metadata).encode("utf-8")
    check(files)
    return [(f"{FOLDER.name}/{name}", files[name]) for name in sorted(files)]


def filled(text: str, values: dict[str, str]) -> str:
    """Metadata with values put in place of those that are there."""
    for key, value in values.items():
        lines = text.split("\n")
        found = [k for k, line in enumerate(lines) if line.startswith(f"{key}=")]
        if not found:
            raise PackageError(f"metadata.txt has no {key}")
        lines[found[0]] = f"{key}={value}"
        text = "\n".join(lines)
    return text


def check(files: dict[str, bytes]) -> None:
    """Refuse what the repository refuses.

    Raises
    ------
    PackageError
        With everything that is wrong.
    """
    parser = configparser.ConfigParser()  # with interpolation, as the repository reads it
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    try:
        parser.read_string(files["metadata.txt"].decode("utf-8"))
        general = dict(parser["general"])
    except (configparser.Error, KeyError, UnicodeDecodeError) as error:
        raise PackageError(f"metadata.txt cannot be read: {error}") from error
    wrong = [f"metadata.txt: {key} is empty" for key in REQUIRED if not general.get(key, "").strip()]
    wrong += [
        f"metadata.txt: {key} is {general[key]!r}, not an address that begins with https://"
        for key in LINKS
        if key != "email" and general.get(key) and not general[key].startswith("https://")
    ]
    wrong += [
        f"{name}: a file that is neither text nor Python"
        for name in files
        if not _is_plain(name, files[name])
    ]
    wrong += [
        f"metadata.txt: {key} is {general[key]!r}, not True or False"
        for key in SWITCHES
        if general.get(key, "False") not in ("True", "False")
    ]
    wrong += [f"{name}: is not there" for name in ("__init__.py", "LICENSE") if name not in files]
    wrong += [f"{name}: a name with .." for name in files if ".." in name]
    if not re.fullmatch(r"\d+(\.\d+)+", general.get("qgisMinimumVersion", "")):
        wrong.append(f"metadata.txt: qgisMinimumVersion is {general.get('qgisMinimumVersion')!r}")
    if "/" in general.get("author", ""):
        wrong.append("metadata.txt: author has a /")
    if sum(map(len, files.values())) > LARGEST:
        wrong.append(f"more than {LARGEST:,} bytes")
    if general.get("icon") not in files:
        wrong.append(f"metadata.txt: the icon {general.get('icon')!r} is not there")
    if wrong:
        raise PackageError("; ".join(wrong))


def _is_plain(name: str, data: bytes) -> bool:
    hidden = any(part.startswith(".") for part in name.split("/"))
    return not hidden and b"\0" not in data and (name == "LICENSE" or Path(name).suffix in SUFFIXES)


def write(folder: Path, metadata: dict[str, str]) -> Path:
    """Write the zip, named after the version.

    Raises
    ------
    PackageError
        As of `contents`.
    """
    files = contents(metadata)
    text = dict(files)[f"{FOLDER.name}/metadata.txt"].decode("utf-8")
    found = re.search(r"^version=(\S+)$", text, re.MULTILINE)
    if found is None:
        raise PackageError("metadata.txt: version is not one word")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{FOLDER.name}.{found.group(1)}.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files:
            entry = zipfile.ZipInfo(name, _OLDEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    return path


def main(words: Sequence[str] = ()) -> int:
    """Build the zip; 1 if it would be refused."""
    parser = argparse.ArgumentParser(
        prog="python -m qgis_uavseg.package", description="Build the zip of the plugin."
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("dist"), help="folder of the zip")
    for name in LINKS:
        parser.add_argument(f"--{name}", help=f"{name} in metadata.txt")
    given = parser.parse_args(words or None)
    values = {name: getattr(given, name) for name in LINKS if getattr(given, name)}
    try:
        path = write(given.output, values)
    except PackageError as error:
        print(f"qgis_uavseg: error: {error}", file=sys.stderr)
        return 1
    print(f"{path}: {path.stat().st_size:,} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
