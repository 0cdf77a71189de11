"""Run notebooks again, in place: `python -m tools.notebooks NOTEBOOK …`, from the root of a checkout.

The state of sliders is left out: to show it, pages would fetch a script from elsewhere. A slider without a kernel says
so in words, and its picture stays.
"""

import sys
from pathlib import Path

import nbformat  # pyright: ignore[reportMissingImports]
from nbclient import NotebookClient  # pyright: ignore[reportMissingImports]


def main(paths: list[str]) -> None:
    """Run each notebook in its folder, and keep what it leaves."""
    for path in map(Path, paths):
        notebook = nbformat.read(path, 4)
        resources = {"metadata": {"path": str(path.parent)}}
        NotebookClient(notebook, timeout=600, store_widget_state=False, resources=resources).execute()
        nbformat.write(notebook, path)


if __name__ == "__main__":
    main(sys.argv[1:])
