"""Names of an environment's observations and actions, as its documentation has them."""

import re
from collections.abc import Sequence

ROW = re.compile(r"^\s*\|\s*(\d+)\s*\|\s*([^|]+?)\s*\|", re.MULTILINE)
ITEM = re.compile(r"^\s*[-*]\s*(\d+):\s*(.+?)\s*$", re.MULTILINE)
MAX_NAME_CHARACTERS = 40


def documented_names(doc: str | None, title: str, size: int) -> tuple[str, ...]:
    """The names of `size` numbers in the section `title` of an environment's docstring.

    Gymnasium's environments have a section "Observation Space" and a section "Action Space", with a table whose rows
    are numbered, or a numbered list. **Returns** nothing where not exactly these numbers are named.
    """
    parts = re.split(rf"^\s*#+\s*{title} Space\s*$", doc or "", maxsplit=1, flags=re.MULTILINE | re.IGNORECASE)
    if len(parts) < 2:
        return ()
    section = re.split(r"^\s*#+\s", parts[1], maxsplit=1, flags=re.MULTILINE)[0]
    return next((names for kind in (ROW, ITEM) if (names := _numbered(kind.findall(section), size))), ())


def _numbered(found: Sequence[tuple[str, str]], size: int) -> tuple[str, ...]:
    if [int(number) for number, _ in found] != list(range(size)):
        return ()
    return tuple(_short(words) for _, words in found)


def _short(words: str) -> str:
    """A name in lower case, without the remarks in brackets."""
    plain = re.sub(r"\s+\([^)]*\)", "", words).replace("`", "").replace("$", "").strip()
    plain = plain.lower() if plain[1:2].islower() else plain
    return plain if len(plain) <= MAX_NAME_CHARACTERS else f"{plain[: MAX_NAME_CHARACTERS - 1]}…"
