"""Ports and constants that have names of the user's own."""

import re
from collections.abc import Sequence
from typing import Any

from motorgrad._errors import check, shown

MOST = 100  # names in a list
_NAME = re.compile(r"[^\W\d]\w{0,39}")


def check_names(setting: str, names: Any, taken: Sequence[str] | set[str] = (), least: int = 0) -> None:
    """Refuse what is no list of different names of letters, digits and `_`, or uses a name that is `taken`."""
    listed = isinstance(names, tuple) and all(isinstance(name, str) for name in names)
    check(listed, setting, names, "a list of names")
    check(least <= len(names) <= MOST, setting, names, f"a list of {least} … {MOST} names")
    for place, name in enumerate(names):
        check(_NAME.fullmatch(name), f"{setting}[{place}]", name, "1 … 40 letters, digits or _, a letter or _ first")
        check(name not in taken, f"{setting}[{place}]", name, "another name: this one has a meaning already")
    repeated = {name for name in names if names.count(name) > 1}
    check(not repeated, setting, names, f"different names, but repeats {', '.join(map(shown, sorted(repeated)))}")
