"""Where the built pages are, and what is said where they are not."""

from pathlib import Path

STATIC = Path(__file__).parent / "static"
NOT_BUILT = (
    "The pages of TimLab's editor are not built. A wheel contains them; in a checkout, run `make editor` or "
    "`python tools/build_editor.py`, then load this page again."
)
