"""Files of a target: the main file and its sidecar files, and whether they may be made."""

import os
import stat
from dataclasses import dataclass
from pathlib import Path

from uavseg.errors import OutputError, OutputExistsError

Path_ = str | os.PathLike[str]

_PAM = (".aux.xml", ".ovr", ".msk", ".ovr.msk", ".msk.ovr")  # GDAL's sidecars of any raster
_APPENDED: dict[str, tuple[str, ...]] = {  # suffixes after the whole name: t.tif.aux.xml
    ".tif": _PAM,
    ".tiff": _PAM,
    ".vrt": _PAM,
    ".png": _PAM,
    ".pgm": _PAM,
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
_SHARED = {".tif": (".wld",), ".tiff": (".wld",), ".png": (".wld",)}  # a sidecar of any raster of that stem
_FOLDERS = {".tiles"}


@dataclass(frozen=True, slots=True)
class Target:
    """A file to be made, with the files that a reader takes as parts of it.

    Parameters
    ----------
    given : Path
        As it was named.
    path : Path
        The file itself: where the name is a symbolic link, the file to which it points.
    """

    given: Path
    path: Path

    @property
    def home(self) -> Path:
        """The folder of its files."""
        return self.path.parent

    def existing(self) -> list[Path]:
        """Its files that are there, the main file first."""
        return existing_files(self.path)


def sidecars(path: Path) -> list[Path]:
    """Names of all files that a reader takes as parts of a file, itself aside."""
    suffix = path.suffix.lower()
    names = [path.name + end for end in _APPENDED.get(suffix, ())]
    for end in _REPLACED.get(suffix, ()):
        names += [path.stem + end, path.stem + end.upper()]  # readers accept both
    return [path.with_name(name) for name in names if name != path.name]


def existing_files(path: Path) -> list[Path]:
    """The files of a target that are there, itself first; a name that only differs in case counts once."""
    found: dict[tuple[int, int], Path] = {}
    for file in (path, *sidecars(path)):
        if os.path.lexists(file):
            about = file.lstat()
            found.setdefault((about.st_dev, about.st_ino) if not file.is_symlink() else (0, len(found)), file)
    return list(found.values())


def check_utf8(path: Path) -> None:
    """The name of what is written is text in UTF-8.

    Raises
    ------
    OutputError
        If it is not.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise OutputError(f"the name {path} is not UTF-8; name the output otherwise") from error


def find_target(path: Path_, overwrite: bool = False) -> Target:
    """The target of that name, if it may be made.

    Raises
    ------
    OutputExistsError
        If one of its files exists and `overwrite` is false.
    OutputError
        If its folder does not exist, or what is there cannot be replaced: a folder, a device, a file that
        other files may need too.
    """
    given = Path(path)
    target = Target(given, _follow(given) if overwrite and given.is_symlink() else given)
    check_utf8(given)
    check_utf8(target.path)
    if not target.home.is_dir():
        raise OutputError(f"the folder {target.home} does not exist; create it first")
    if given.is_dir():
        raise OutputError(f"{given} is a folder; name a file in it")
    files = target.existing()
    if files and not overwrite:
        raise OutputExistsError(_exists_text(given, files[0]))
    for file in files:
        _check_replaceable(target, file)
    _check_shared(target)
    return target


def _exists_text(given: Path, file: Path) -> str:
    what = f"{file} exists" if file == given else f"{file} exists and is a part of {given.name}"
    return f"{what}; give --overwrite (overwrite=True) to replace it"


def _follow(link: Path) -> Path:
    """The file to which a link points, which may be absent.

    Raises
    ------
    OutputError
        If the link leads in a circle or to a name of another kind, or if files beside the link would be read
        as parts of it.
    """
    path = Path(os.path.realpath(link))
    if path.is_symlink():
        raise OutputError(
            f"{link} is a symbolic link that leads in a circle; remove it, or name another file"
        )
    if path.suffix.lower() != link.suffix.lower():
        raise OutputError(f"{link} is a symbolic link to {path}, which does not end in {link.suffix}")
    own = {os.path.realpath(file) for file in sidecars(path)}
    for part in sidecars(link):
        if os.path.lexists(part) and os.path.realpath(part) not in own:
            raise OutputError(f"{link} is a symbolic link, and {part} is no part of {path}; move it away")
    return path


def _check_replaceable(target: Target, file: Path) -> None:
    """A file of the target is one that may be replaced: a regular file, or the folder of tiles."""
    mode = file.lstat().st_mode
    if stat.S_ISREG(mode) or (stat.S_ISDIR(mode) and file.suffix.lower() in _FOLDERS):
        return
    if stat.S_ISLNK(mode):
        what = "a symbolic link"
    else:
        what = "a folder" if stat.S_ISDIR(mode) else "no regular file"
    raise OutputError(f"{file} belongs to {target.given} and is {what}; move it away, or name another file")


def _check_shared(target: Target) -> None:
    path = target.path
    for end in _SHARED.get(path.suffix.lower(), ()):
        for file in (path.with_suffix(end), path.with_suffix(end.upper())):
            if os.path.lexists(file):
                raise OutputError(
                    f"{file} would be read as a part of {target.given} and may belong to another file; "
                    "move it away, or choose another name"
                )
