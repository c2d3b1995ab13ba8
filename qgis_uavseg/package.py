"""Zip of the plugin for the repository of QGIS: `python -m qgis_uavseg.package -o DIR`.

The names and keys checked are those of the repository's validator: one folder, metadata that are complete, a
LICENSE, no binaries, hidden or compiled files. The zip holds the same bytes each time. Links, authors and
their email are those of pyproject.toml; options take their place.
"""

from __future__ import annotations

import argparse
import configparser
import re
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import tomllib

T = TypeVar("T")
FOLDER = Path(__file__).resolve().parent
LICENSE = FOLDER.parent / "LICENSE"
PYPROJECT = FOLDER.parent / "pyproject.toml"
URLS = {  # labels in [project.urls] that are well known, in lower case without spaces and punctuation
    "homepage": ("homepage",),
    "repository": ("repository", "source", "sourcecode", "github"),
    "tracker": ("issues", "tracker", "issuetracker", "bugtracker", "bugs", "bugreports"),
}
LINKS = (*URLS, "email")
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
    """Metadata with values put in place of those that are there.

    Raises
    ------
    PackageError
        If there is no such key, or a value is not one line.
    """
    for key, value in values.items():
        if value.splitlines() != [value]:
            raise PackageError(f"{key} is {value!r}, not one line of text")
        lines = text.split("\n")
        found = [k for k, line in enumerate(lines) if line.startswith(f"{key}=")]
        if not found:
            raise PackageError(f"metadata.txt has no {key}")
        lines[found[0]] = f"{key}={value}"
        text = "\n".join(lines)
    return text


def project_metadata(pyproject: Path) -> dict[str, str]:
    """Read links, names of the authors and the first email of them; what is not there is left out.

    Parameters
    ----------
    pyproject : Path
        A pyproject.toml with `[project.urls]` (Homepage, Repository or Source, Issues or Tracker, in any
        case), and `authors` of `[project]`.

    Raises
    ------
    PackageError
        If the file cannot be read, or has something else in their place.
    """
    try:
        content = tomllib.loads(pyproject.read_text(encoding="utf-8"))
        project = _typed(dict, content.get("project", {}), "[project]")
        urls = {
            re.sub(r"[\W_]", "", label).lower(): _typed(str, url, label)
            for label, url in _typed(dict, project.get("urls", {}), "[project.urls]").items()
        }
        listed = _typed(list, project.get("authors", []), "authors")
        authors = [_typed(dict, author, "an author") for author in listed]
        names = [_typed(str, author["name"], "a name") for author in authors if "name" in author]
        emails = [_typed(str, author["email"], "an email") for author in authors if "email" in author]
    except (OSError, ValueError, TypeError) as error:
        raise PackageError(f"{pyproject} cannot be read: {error}") from error
    found = {key: urls[label] for key, labels in URLS.items() for label in reversed(labels) if label in urls}
    return {
        **found,
        **({"email": emails[0]} if emails else {}),
        **({"author": ", ".join(names)} if names else {}),
    }


_KINDS: dict[type, str] = {dict: "a table", list: "a list", str: "a text"}


def _typed(kind: type[T], value: object, name: str) -> T:
    if not isinstance(value, kind):
        raise TypeError(f"{name} is {value!r}, not {_KINDS[kind]}")
    return value


def refuse_missing(metadata: dict[str, str], pyproject: Path) -> None:
    """Refuse metadata without one of the links or the email.

    Raises
    ------
    PackageError
        With all that are missing, and where they can be written.
    """
    missing = [key for key in LINKS if not metadata.get(key, "").strip()]
    if not missing:
        return
    labels = [{"tracker": "Issues"}.get(key, key.capitalize()) for key in missing if key != "email"]
    places = [f"{', '.join(labels)} under [project.urls]"] if labels else []
    places += ["an email in authors of [project]"] if "email" in missing else []
    raise PackageError(
        f"the repository of QGIS requires {', '.join(missing)}: write {' and '.join(places)} in {pyproject}, "
        f"or give {', '.join(f'--{key}' for key in missing)}"
    )


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
        parser.add_argument(f"--{name}", help=f"{name} in metadata.txt, in place of that of pyproject.toml")
    given = parser.parse_args(words or None)
    values = {name: getattr(given, name) for name in LINKS if getattr(given, name)}
    try:
        metadata = {**project_metadata(PYPROJECT), **values}
        refuse_missing(metadata, PYPROJECT)
        path = write(given.output, metadata)
    except PackageError as error:
        print(f"qgis_uavseg: error: {error}", file=sys.stderr)
        return 1
    print(f"{path}: {path.stat().st_size:,} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
