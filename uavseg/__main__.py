"""`uavseg` as a program of its own, which is also `python -m uavseg`."""

import sys
from importlib.abc import MetaPathFinder
from typing import Any

UNUSED = ("pandas", "geopandas")
READING = ("plan", "preview", "match")  # the commands that read files of regions, for which both are used


class Absent(MetaPathFinder):
    """Finds that a module is not installed, whether it is or not."""

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> None:
        """Say so of what is not used."""
        if fullname in UNUSED:
            raise ModuleNotFoundError(f"No module named {fullname!r}", name=fullname)


def run() -> None:
    """Run the command line.

    pyogrio loads pandas and geopandas where they are installed: a third of a second and 45 MB of which most
    commands use nothing, so for those they count as absent.
    """
    if sys.argv[1:2] and sys.argv[1] not in READING:
        sys.meta_path.insert(0, Absent())
    from uavseg.cli import main

    main(prog_name="uavseg")


if __name__ == "__main__":
    run()
