"""Access policy: which files and addresses the content of a file may name.

A file that the user names is opened, whatever it is. One that the content of a file names (sources of a VRT,
the image of a ROS map, the rasters of a block map) is opened only in the folder of that file or below it, or
in folders that the user allows; and over the network only if the user allows that. See docs/security.md.
"""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from uavseg.dataclass import dataclass
from uavseg.errors import AccessError, RasterReadError, caused_errors
from uavseg.inputs import regular_file

_NETWORK = re.compile(
    r"(?:/vsi(?:curl|s3|gs|az|adls|oss|swift)(?:_streaming)?[/?]|/vsi(?:hdfs|webhdfs)/|[a-z][a-z0-9+.-]*://)",
    re.IGNORECASE,
)
_LOCAL_SCHEMES = ("file://", "zip://", "tar://", "gzip://", "vrt://")


@dataclass(frozen=True, slots=True)
class AccessPolicy:
    """Folders and addresses that the content of a file may name, beside its folder."""

    allow_paths: tuple[str, ...] = ()  # folders from and below which files may be opened
    allow_network: bool = False

    def check_file(self, owner: str | os.PathLike[str], named: str | os.PathLike[str]) -> Path:
        """Refuse a file that the content of `owner` may not name, else return its path.

        Symbolic links and `..` are resolved before folders are compared. An AccessError says that it lies
        neither beside the owner nor in an allowed folder, a RasterReadError that it is not a regular file.
        """
        target = Path(named)
        invalid = f"{os.fspath(owner)} names {named}, which is no valid path"
        with caused_errors(invalid, AccessError, OSError, ValueError, RuntimeError, form="{}"):
            resolved = target.resolve()
            allowed = any(resolved.is_relative_to(folder) for folder in self._folders(Path(owner)))
        if not allowed:
            raise AccessError(
                f"{os.fspath(owner)} names {named}, which lies outside of its folder; allow the folder with "
                f"--allow-path {resolved.parent} (allow_path in Python) if you trust this file"
            )
        what = f"{os.fspath(owner)} names a file that cannot be read"
        return regular_file(target, lambda text: RasterReadError(f"{what}: {text}"))

    def check_address(self, owner: str | os.PathLike[str], named: str) -> None:
        """Refuse an address that the content of `owner` names, if requests are not allowed (AccessError)."""
        if not self.allow_network:
            raise AccessError(
                f"{os.fspath(owner)} names the address {named}; allow requests with --allow-network "
                "(allow_network=True in Python) if you trust this file"
            )

    def check_name(self, owner: str | os.PathLike[str], named: str, folder: Path) -> Path | None:
        """Refuse a path or an address that the content of `owner` may not name (AccessError).

        A path is relative to `folder`, and returned as of `check_file`; None for an address.
        """
        if is_address(named):
            self.check_address(owner, named)
            return None
        if not named or named.startswith(("/vsi", "<", "{")) or "\0" in named or re.match(r"\w{2,}:", named):
            shown = named if len(named) <= 60 else f"{named[:57]}..."
            why = "neither a file nor an address"
            raise AccessError(f"{os.fspath(owner)} names {shown!r}, {why}; name the file itself")
        return self.check_file(owner, folder / named)

    def _folders(self, owner: Path) -> Iterator[Path]:
        yield owner.parent.resolve()
        yield owner.resolve().parent
        for folder in self.allow_paths:
            yield Path(folder).resolve()


def is_address(name: str) -> bool:
    """Return whether a name is opened over the network: a URL, or a path of GDAL's network file systems.

    Examples
    --------
    >>> is_address("/vsicurl/https://example.org/a.tif"), is_address("/vsizip/a.zip/a.tif")
    (True, False)
    """
    return _NETWORK.match(name) is not None and not name.lower().startswith(_LOCAL_SCHEMES)


STRICT = AccessPolicy()
_policy: ContextVar[AccessPolicy] = ContextVar("policy", default=STRICT)


def current_policy() -> AccessPolicy:
    """Return the policy in effect, by default the strict one."""
    return _policy.get()


Folders = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


@contextmanager
def allowing(allow_path: Folders = (), allow_network: bool = False) -> Iterator[None]:
    """Allow files to name others in these folders, and addresses if the network is allowed.

    AccessError is raised if one is not a folder.
    """
    folders = [allow_path] if isinstance(allow_path, str | os.PathLike) else list(allow_path)
    for folder in folders:
        if not os.path.isdir(folder):  # noqa: PTH112 - false for a name that is too long
            raise AccessError(f"{os.fspath(folder)} is not a folder; allow a folder that exists")
    token = _policy.set(AccessPolicy(tuple(os.fspath(folder) for folder in folders), bool(allow_network)))
    try:
        yield
    finally:
        _policy.reset(token)
