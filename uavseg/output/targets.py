"""Output targets: their files with sidecars, names from templates, and inputs that are never replaced."""

import os
import re
import stat
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePath

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, OutputExistsError, caused_errors

_PAM = (".aux.xml", ".ovr", ".msk", ".ovr.msk", ".msk.ovr")  # GDAL's sidecars of any raster
_APPENDED: dict[str, tuple[str, ...]] = {  # suffixes after the whole name: t.tif.aux.xml
    **dict.fromkeys((".tif", ".tiff", ".vrt", ".png", ".pgm"), _PAM),
    ".gpkg": ("-wal", "-shm", "-journal", ".aux.xml"),  # of SQLite, which replays them into any t.gpkg
    ".shp": (".xml",),
}
_REPLACED: dict[str, tuple[str, ...]] = {  # suffixes in place of its own: t.dbf
    ".shp": (
        *(".shx", ".dbf", ".prj", ".cpg", ".qpj", ".dbt"),
        *(".qix", ".sbn", ".sbx", ".idm", ".ind", ".fbn", ".fbx", ".ain", ".aih", ".ixs", ".mxs", ".cst"),
    ),
    ".tif": (".tfw", ".tifw"),
    ".tiff": (".tfw", ".tiffw"),
    ".png": (".pgw", ".pngw"),
    ".vrt": (".tiles",),
}
_SHARED = dict.fromkeys((".tif", ".tiff", ".png"), (".wld",))  # a sidecar of any raster of that stem
_FOLDERS = {".tiles", ".parquet"}  # of files that are one output
_PLACEHOLDER = re.compile(r"\{\{|\}\}|\{([^{}]*)\}|[{}]")
_PLACEHOLDERS = "{stem}, {name}, {suffix}, {parent} or {number}"


@dataclass(frozen=True, slots=True)
class Target:
    """A file to be made with its sidecars, as `given`; `path` is where symbolic links lead."""

    given: Path
    path: Path

    @property
    def home(self) -> Path:
        """Return the folder of its files."""
        return self.path.parent


def sidecars(path: Path) -> list[Path]:
    """Return the names of all files that a reader takes as parts of a file, except for itself."""
    suffix = path.suffix.lower()
    names = [path.name + end for end in _APPENDED.get(suffix, ())]
    for end in _REPLACED.get(suffix, ()):
        names += [path.stem + end, path.stem + end.upper()]  # readers accept both
    return [path.with_name(name) for name in names if name != path.name]


def existing_files(path: Path) -> list[Path]:
    """List the existing files of a target, itself first; a name that only differs in case counts once."""
    files: dict[tuple[int, int], Path] = {}
    for file in (path, *sidecars(path)):
        if os.path.lexists(file):
            status = file.lstat()
            key = (0, len(files)) if file.is_symlink() else (status.st_dev, status.st_ino)
            files.setdefault(key, file)
    return list(files.values())


def check_utf8(path: Path) -> None:
    """Refuse the name of an output that is not UTF-8."""
    refusal = f"the name {path} is not UTF-8; name the output otherwise"
    with caused_errors(refusal, OutputError, UnicodeEncodeError, form="{}"):
        str(path).encode()


def find_target(path: Path_, overwrite: bool = False) -> Target:
    """Return the target of a name, if it may be written.

    An OutputExistsError says that one of its files exists and `overwrite` is false, an OutputError that its
    folder does not exist, or that an existing file cannot be replaced: a folder, a device, a file that other
    files may need too.
    """
    given = Path(path)
    target = Target(given, _follow(given) if overwrite and given.is_symlink() else given)
    check_utf8(given)
    check_utf8(target.path)
    if not target.home.is_dir():
        raise OutputError(f"the folder {target.home} does not exist; create it first")
    if given.is_dir() and given.suffix.lower() not in _FOLDERS:
        raise OutputError(f"{given} is a folder; name a file in it")
    files = existing_files(target.path)
    if files and not overwrite:
        part = "" if files[0] == given else f" and is a part of {given.name}"
        raise OutputExistsError(f"{files[0]} exists{part}; give --overwrite (overwrite=True) to replace it")
    for file in files:
        _check_replaceable(target, file)
    _check_shared(target)
    return target


def _follow(link: Path) -> Path:
    """Return the file to which a link points, which may be absent; refuse one with other sidecars."""
    path = Path(os.path.realpath(link))
    if path.is_symlink():
        why = "is a symbolic link that leads in a circle"
        raise OutputError(f"{link} {why}; remove it, or name another file")
    if path.suffix.lower() != link.suffix.lower():
        raise OutputError(f"{link} is a symbolic link to {path}, which does not end in {link.suffix}")
    parts = {os.path.realpath(file) for file in sidecars(path)}
    for part in sidecars(link):
        if os.path.lexists(part) and os.path.realpath(part) not in parts:
            raise OutputError(f"{link} is a symbolic link, and {part} is no part of {path}; move it away")
    return path


def _check_replaceable(target: Target, file: Path) -> None:
    """Refuse to replace anything but a regular file or a folder that is one output."""
    mode = file.lstat().st_mode
    if stat.S_ISREG(mode) or (stat.S_ISDIR(mode) and file.suffix.lower() in _FOLDERS):
        return
    file_type = "a folder" if stat.S_ISDIR(mode) else "no regular file"
    file_type = "a symbolic link" if stat.S_ISLNK(mode) else file_type
    what = f"{file} belongs to {target.given} and is {file_type}"
    raise OutputError(f"{what}; move it away, or name another file")


def _check_shared(target: Target) -> None:
    path = target.path
    for end in _SHARED.get(path.suffix.lower(), ()):
        for file in (path.with_suffix(end), path.with_suffix(end.upper())):
            if os.path.lexists(file):
                raise OutputError(
                    f"{file} would be read as a part of {target.given} and may belong to another file; "
                    "move it away, or choose another name"
                )


def check_not_inputs(outputs: Iterable[Path_ | None], inputs: Iterable[Path_]) -> None:
    """Refuse outputs that would replace an input of the same command, by whatever name.

    The output "-" is standard output. Sidecar files of inputs are inputs too; whatever is not a local file is
    left out.
    """
    named = [path for path in outputs if path is not None and path != "-"]
    made = {file: path for path in named for file in _files_of(Path(os.path.realpath(path)))}
    if not made:
        return
    read = {_identity(file): path for path in inputs for file in _files_of(Path(path))}
    for file, output in made.items():
        if (identity := _identity(file)) is not None and identity in read:
            why = f"{output} would replace {read[identity]}, which is read for it"
            raise OutputError(f"{why}; name another output")


def _files_of(path: Path) -> list[Path]:
    """List the existing files of a path, and the content of its folders."""
    files = existing_files(path)
    return [*files, *(file for folder in files if folder.is_dir() for file in folder.iterdir())]


def _identity(file: Path) -> tuple[int, int] | None:
    """Return device and inode, which are the same for every name of a file; None if there is none."""
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def fill_template(template: str, source: str, number: int = 1) -> str:
    """Fill in the name of the output of a source.

    In a template ``{stem}`` is the name of the source without folder and extension, ``{name}`` with its
    extension, ``{suffix}`` the extension without point, ``{parent}`` the name of its folder, and ``{number}``
    its place in the list, from 0001; ``{{`` and ``}}`` are braces.

    Examples
    --------
    >>> fill_template("out/{parent}-{stem}.gpkg", "sheets/a.tif")
    'out/sheets-a.gpkg'
    >>> fill_template("{steam}.gpkg", "a.tif")
    Traceback (most recent call last):
    uavseg.errors.OutputError: {steam}.gpkg: {steam} is unknown; write {stem}, {name}, {suffix}, ...
    """
    path = PurePath(source)
    values = {
        "stem": path.stem,
        "name": path.name,
        "suffix": path.suffix.removeprefix("."),
        "parent": path.parent.name or Path(os.path.abspath(source)).parent.name,  # noqa: PTH100 - keeps links
        "number": f"{number:04d}",
    }

    def replaced(match: re.Match[str]) -> str:
        if match[0] in ("{{", "}}"):
            return match[0][0]
        if match[1] not in values:
            raise OutputError(
                f"{template}: {match[0]} is unknown; write {_PLACEHOLDERS}, and {{{{ for a brace"
            )
        return values[match[1]]

    return _PLACEHOLDER.sub(replaced, template)


def outputs_of(template: str, sources: Sequence[str]) -> list[str]:
    """Fill in the name of the output of each source; as `fill_template`."""
    return [fill_template(template, source, number) for number, source in enumerate(sources, start=1)]


def check_distinct_outputs(sources: Sequence[str], outputs: Iterable[Sequence[str]]) -> None:
    """Refuse two outputs of the same name; `outputs` are those of each source."""
    owners: dict[str, str] = {}
    for source, names in zip(sources, outputs, strict=True):
        for name in names:
            key = os.path.normcase(os.path.realpath(name))
            if key in owners:
                raise OutputError(
                    f"{owners[key]} and {source} would both be written to {name}; give each an output of its "
                    f"own with {_PLACEHOLDERS} in the name"
                )
            owners[key] = source
