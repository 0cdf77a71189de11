"""Settings that are numbers: refused early where they are none, as files may say anything."""

import math
from typing import Any

from motorgrad._errors import check

MOST = 10_000
MOST_PARAMETERS = 1_000_000


def check_count(name: str, value: Any) -> None:
    """Refuse what is no sensible number of units, inputs or parameters."""
    whole = isinstance(value, int) and not isinstance(value, bool)
    check(whole and 1 <= value <= MOST, name, value, f"a whole number in 1 … {MOST}")


def check_numbers(block: Any, *names: str, whole: bool = False) -> None:
    """Refuse settings that are no finite numbers, or no whole ones; their ranges are the library's matter."""
    for name in names:
        value = getattr(block, name)
        number = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
        check(number and math.isfinite(value), name, value, "a whole number" if whole else "a finite number")


def check_size(value: Any) -> None:
    """Refuse what is no number of parameters."""
    whole = isinstance(value, int) and not isinstance(value, bool)
    check(whole and 1 <= value <= MOST_PARAMETERS, "size", value, f"a whole number in 1 … {MOST_PARAMETERS}")
