"""Units of the quantities that tasks report."""

UNITS = {"apex": "m", "speed": "m/s", "net": "m/s", "length": "steps", "falls": "1/s"}


def with_unit(name: str, unit: str = "") -> str:
    """A quantity's name with its unit in brackets, where it has one; by default that of a task's reading."""
    unit = unit or UNITS.get(name, "")
    return f"{name} ({unit})" if unit else name
