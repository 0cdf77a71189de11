"""`motorgrad list`: tasks, policies, estimators and experiments."""

import dataclasses
import inspect
from pathlib import Path
from typing import Any

from motorgrad._commands._configuration import parse
from motorgrad._commands._results import write_json
from motorgrad.experiments import EXPERIMENTS
from motorgrad.learning import Estimator
from motorgrad.policies import INITIAL
from motorgrad.tasks import TASKS


@dataclasses.dataclass(frozen=True)
class List:
    """List every task, policy, estimator and experiment by the name that configurations and commands take."""

    json: Path | None = None
    """Also write the list to this file, as JSON; - for the standard output."""


def run(arguments: list[str]) -> int:
    options = parse(List, arguments, "list")
    estimators = {name: ", ".join(f"{k} {v}" for k, v in parts.items()) for name, parts in Estimator.presets.items()}
    found = {
        "tasks": {name: _first_line(task) for name, task in TASKS.items()},
        "policies": {name: _first_line(make) for name, make in INITIAL.items()},
        "estimators": estimators,
        "experiments": {name: f"{kind.source}: {kind.title}" for name, kind in EXPERIMENTS.items()},
    }
    if str(options.json) != "-":
        for kind, entries in found.items():
            print(kind)
            width = max(map(len, entries))
            for name, what in entries.items():
                print(f"  {name:<{width}}  {what}")
    write_json(options.json, found)
    return 0


def _first_line(thing: Any) -> str:
    return (inspect.getdoc(thing) or "").partition("\n")[0]
