"""The folder of the built pages, and the message if they are missing."""

from pathlib import Path

STATIC = Path(__file__).parent / "static"
_SOURCES = Path(__file__).parent / "frontend"  # which no installation has
_CHECKOUT = (
    f"run `make editor` or `python apps/timlab/tools/build_editor.py` in the checkout, {Path(__file__).parents[5]}, "
    "then load this page again."
)
_INSTALLED = (
    f"this installation, {Path(__file__).parents[2]}, was made without them. In the folder that it was installed from, "
    "`pip install --force-reinstall --no-deps .` builds them with Node.js 20.19 or later (https://nodejs.org), and "
    "fetches one where there is none; it says why where it cannot (add -v)."
)
NOT_BUILT = f"The pages of TimLab's editor are not built: {_CHECKOUT if _SOURCES.is_dir() else _INSTALLED}"
