"""Execute a notebook from top to bottom: in place, or with --check to see that it still runs."""

import argparse
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("notebook", type=Path)
    parser.add_argument("--check", action="store_true", help="write nothing; fail where a cell fails")
    given = parser.parse_args()
    notebook = nbformat.read(given.notebook, as_version=4)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": given.notebook.parent}}).execute()
    if not given.check:
        for cell in notebook.cells:
            cell.metadata.pop("execution", None)  # times, which would differ every time
        nbformat.write(notebook, given.notebook)
    print(f"{given.notebook}: {sum(cell.cell_type == 'code' for cell in notebook.cells)} cells ran")


if __name__ == "__main__":
    main()
