"""The folder of the built pages, and the message if they are missing."""

from pathlib import Path

STATIC = Path(__file__).parent / "static"
NOT_BUILT = (
    "The pages of TimLab's editor are not built. A wheel contains them; in a checkout, run `make editor` or "
    "`python tools/build_editor.py`, then load this page again."
)
