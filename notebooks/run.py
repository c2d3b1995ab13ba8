"""Execute a notebook from top to bottom and save its outputs, or only check that it runs (--check)."""

import argparse
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("notebook", type=Path)
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit with an error if a cell fails"
    )
    options = parser.parse_args()
    notebook = nbformat.read(options.notebook, as_version=4)
    folder = {"metadata": {"path": options.notebook.parent}}
    NotebookClient(notebook, timeout=600, resources=folder).execute()
    if not options.check:
        for cell in notebook.cells:
            cell.metadata.pop("execution", None)  # timestamps, which differ in every run
        nbformat.write(notebook, options.notebook)
    print(f"{options.notebook}: {sum(cell.cell_type == 'code' for cell in notebook.cells)} cells executed")


if __name__ == "__main__":
    main()
