"""The commands of `motorgrad`, one module each with a function `run(arguments) -> exit status`."""

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
IMPORTED: list[str] = []
"""The modules that `--import` named, which other processes of a command import, too."""
