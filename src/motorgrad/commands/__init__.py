"""The commands of `motorgrad`, here or in an application: one module each with `run(arguments) -> exit status`."""

import importlib
from collections.abc import Callable

from motorgrad._errors import choice

COMMANDS = {
    "list": "list every task, policy, estimator, part of a learner and experiment",
    "train": "train a learner, into a run directory that can be resumed",
    "evaluate": "evaluate a learned policy: its numbers and a video",
    "export": "write a learned policy as C, as an ONNX model or for NumPy",
    "sweep": "run a study, tasks × settings × seeds, on one machine or many",
    "compare": "compare methods: tune each on some seeds, judge it on others",
    "plot": "plot learning curves of one run or of several",
    "reproduce": "measure figures and claims of the thesis again; write a report",
    "sim": "watch a body, its muscles and its learner live in the browser",
    "demo": "train a body to hop, in about two minutes",
    "lab": "TimLab: build diagrams of blocks, run and retune them, in a browser",
    "bench": "measure the speed table: this library, bare physics, hand-written loops",
    "completion": "print a script that completes commands and options in bash, zsh or fish",
}
"""What each command does, by name."""
EXTRA_OF_COMMAND = {"reproduce": "thesis", "demo": "thesis", "sim": "sim", "lab": "lab"}
"""The commands that an application offers, and the extra that installs it."""


def command_named(name: str) -> Callable[[list[str]], int]:
    """The function of a command, which loads nothing that only others need: the `run` of its module, or what an
    installed distribution offers. **Raises** `ValueError` for an unknown command, `MissingExtra` for one of an
    application that is not installed."""
    if name in COMMANDS and name not in EXTRA_OF_COMMAND:
        return importlib.import_module(f"motorgrad.commands.{name}").run
    from motorgrad._applications import OFFERED_COMMANDS, entries, offered

    choice("command", name, [*COMMANDS, *entries(OFFERED_COMMANDS)])
    return offered(name, "this command needs", EXTRA_OF_COMMAND.get(name, ""), OFFERED_COMMANDS)
