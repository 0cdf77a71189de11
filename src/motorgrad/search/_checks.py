"""What several settings of searches must be."""

from typing import Any

import numpy as np

from motorgrad._errors import check


def whole(name: str, value: Any, least: int) -> None:
    """Refuse anything but a whole number of at least so much."""
    right = isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= least
    check(right, name, value, f"a whole number >= {least}")
