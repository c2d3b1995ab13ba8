"""SQLite databases of strangers (GeoPackage, MBTiles, bags): what they call, and whether their views end.

A view is a query that runs when its rows are read, inside of GDAL, which no signal stops: it may never end
(`WITH RECURSIVE`), or multiply tables. So each view is tried first, under an authorizer and a bound.
"""

import os
import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from uavseg.errors import AccessError, UavsegError
from uavseg.output.staging import interrupts_held
from uavseg.plain_text import cause_of, shown

MAX_STEPS = 30_000_000  # of SQLite's virtual machine for the rows of one view: a second or less
_STEPS = 100_000  # between two looks at their number
_SELECTS = 2  # ours and that of the view, which has no queries in it and reads no other view
_FUNCTIONS = frozenset(  # whose time is that of their arguments
    {"abs", "avg", "coalesce", "count", "ifnull", "length", "lower", "max", "min", "nullif", "round", "sum"}
    | {"total", "upper"}
)


@contextmanager
def open_database(source: str | os.PathLike[str] | bytes) -> Iterator[sqlite3.Connection]:
    """Open a database to be read; of bytes, a copy in memory."""
    if isinstance(source, bytes):
        database = sqlite3.connect(":memory:")
    else:
        address = f"{Path(source).resolve().as_uri()}?mode=ro&immutable=1"
        database = sqlite3.connect(address, uri=True)
    try:
        if isinstance(source, bytes):
            database.deserialize(source)
        yield database
    finally:
        database.close()


def check_database(
    source: str | os.PathLike[str] | bytes, name: str, error: Callable[[str], UavsegError]
) -> None:
    """Refuse virtual tables other than indexes, and views that call functions or may not end.

    `name` is for messages; `error` makes of a message the exception of a database that cannot be read. An
    AccessError says that it has such a table or view.
    """
    try:
        with open_database(source) as database:
            database.text_factory = lambda text: text.decode("utf-8", "surrogateescape")
            found = database.execute(
                "SELECT type, name, sql FROM sqlite_master WHERE sql NOT NULL"
            ).fetchall()
            for kind, named, definition in found:
                if kind == "view":
                    _check_view(database, str(named), name)
                else:
                    _check_table(str(definition), name)
    except (sqlite3.Error, UnicodeError) as cause:
        raise error(f"{name} cannot be read: {cause_of(cause)}") from cause


def _check_table(definition: str, name: str) -> None:
    virtual = re.match(
        r"\s*create\s+virtual\s+table.*?\susing\s+(\w+)", definition, re.IGNORECASE | re.DOTALL
    )
    if virtual and not virtual[1].lower().startswith(("rtree", "fts")):
        raise AccessError(f"{name} has a virtual table of {virtual[1]}, which may read other files")


def _check_view(database: sqlite3.Connection, view: str, name: str) -> None:
    """Compile the query of a view, in which little is authorized, and count its rows within the bound."""
    quoted = '"' + view.replace('"', '""') + '"'
    selects = steps = 0

    def authorize(action: int, _: str | None, function: str | None, *others: str | None) -> int:
        nonlocal selects
        selects += action == sqlite3.SQLITE_SELECT
        is_denied = action == sqlite3.SQLITE_RECURSIVE or selects > _SELECTS
        is_denied |= action == sqlite3.SQLITE_FUNCTION and str(function).lower() not in _FUNCTIONS
        return sqlite3.SQLITE_DENY if is_denied else sqlite3.SQLITE_OK

    def is_beyond() -> bool:
        nonlocal steps
        steps += _STEPS
        return steps > MAX_STEPS

    try:
        database.set_authorizer(authorize)
        database.execute(f"EXPLAIN SELECT * FROM {quoted}").fetchall()
        database.set_authorizer(None)
        database.set_progress_handler(is_beyond, _STEPS)
        with interrupts_held():  # in the handler, they would look like its answer
            database.execute(f"SELECT count(*) FROM {quoted}").fetchall()
    except sqlite3.Error as error:
        raise AccessError(
            f"{name} has the view {shown(view)}, which may call functions or never end ({cause_of(error)}); "
            "save its rows as a layer of their own (in QGIS: Export, Save Features As)"
        ) from error
    finally:
        database.set_authorizer(None)
        database.set_progress_handler(None, 0)
