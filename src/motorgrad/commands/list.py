"""`motorgrad list`: tasks, policies, estimators and experiments."""

import dataclasses
import inspect
import re
from collections.abc import Mapping
from pathlib import Path

from motorgrad._applications import LISTS
from motorgrad._applications import entries as offers
from motorgrad._errors import choice
from motorgrad.learning import PRESETS, PURPOSES, Estimator, measured
from motorgrad.options import json_help, parse, write_json
from motorgrad.policies import INITIAL
from motorgrad.schema import PART_CLASSES, Settings, name_in_words, static
from motorgrad.tasks import TASKS


@dataclasses.dataclass(frozen=True)
class List(Settings):
    """List every task, policy, estimator, part of a learner and experiment by its name in configurations and
    commands."""

    what: str | None = static(
        None,
        positional="[WHAT]",
        help="Only what has this name: `tasks`, `presets`, `policies`, `estimators` and so on",
    )
    json: Path | None = static(None, help=json_help("the list"))


def run(arguments: list[str]) -> int:
    options = parse(List, arguments, "list")
    estimators = {
        name: {part: value["kind"] if isinstance(value, Mapping) else value for part, value in parts.items()}
        for name, parts in Estimator.presets.items()
    }
    found = {
        "tasks": {name: _first_line(TASKS[name]) for name in sorted(TASKS)},
        "presets": {name: _about_preset(name) for name in PRESETS},
        "policies": {name: _first_line(make) for name, make in INITIAL.items()},
        "estimators": {
            name: ", ".join(f"{part} {kind}" for part, kind in of.items()) for name, of in estimators.items()
        },
        **{
            f"kinds of {name_in_words(place)}": {name: _first_line(kind) for name, kind in kinds.items()}
            for place, kinds in PART_CLASSES.items()
            if len(kinds) > 1 and kinds is not INITIAL
        },
        **{name: offer.load()() for name, offer in offers(LISTS).items()},
    }
    if options.what is not None:
        choice("what", options.what, found)
        found = {options.what: found[options.what]}
    if str(options.json) != "-":
        for kind, entries in found.items():
            print(kind)
            width = max(map(len, entries))
            for name, what in entries.items():
                print(f"  {name:<{width}}  {what}")
    write_json(options.json, found)
    return 0


def _about_preset(name: str) -> str:
    """What a preset is for; what a decision costs, and what the preset was seen to reach, where it was measured."""
    found = f"for {PURPOSES[name]}"
    seen = measured(name)
    if seen is None:
        return found
    reached = "; ".join(f"{task} {value}" for task, value in seen.reached.items())
    return f"{found}. {seen.cost} ms of processor time a decision. Reached: {reached}"


def _first_line(thing: object) -> str:
    """The first sentence of a docstring, without its formulas."""
    paragraph = " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())
    return re.sub(r",? \$[^$]*\$", "", paragraph).partition(". ")[0].rstrip(".")
