"""Units of the quantities that tasks report."""

from collections.abc import Sequence

from motorgrad.tasks import Task


def unit_of(name: str, task: Task | None) -> str:
    """The unit of a metric in words; empty where it is unknown, or the number is pure."""
    return "" if task is None else task.metric_units.get(name, "").removeprefix("1")


def observation_units(task: Task | None, names: Sequence[str]) -> Sequence[str]:
    """The units of what is observed by these names; none where it is scaled."""
    known = () if task is None else task.input_units
    return known if len(known) == len(names) else [""] * len(names)
