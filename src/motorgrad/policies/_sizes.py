"""How many inputs and outputs a policy for a task has."""

from typing import Any

from motorgrad._errors import check


def sizes(task: Any, outputs: int | None) -> tuple[int, int]:
    sized = isinstance(task, int) or all(hasattr(task, name) for name in ("observation_size", "action_size"))
    check(sized and not isinstance(task, type), "task", task, "a task, such as motorgrad.make('hopper'), or a number")
    inputs = task if isinstance(task, int) else task.observation_size
    outputs = (None if isinstance(task, int) else task.action_size) if outputs is None else outputs
    check(inputs > 0, "inputs", inputs, "a positive number of inputs")
    check(outputs is not None and outputs > 0, "outputs", outputs, "a positive number of units or actions")
    return inputs, int(outputs or 0)
