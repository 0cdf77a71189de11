"""The command line. Thin: every command is a typed dataclass and one call of the library."""

import os
import sys
from collections.abc import Callable
from typing import NoReturn

from motorgrad._signals import asked, interrupt_when_asked

COMMANDS = {
    "list": "every task, policy, estimator and experiment",
    "train": "learn; progress bar; a run directory; goes on where it stopped",
    "evaluate": "a learnt policy without learning: its numbers and a video",
    "plot": "learning curves of one run or of several",
    "reproduce": "figures and claims of the thesis, measured again; a report",
    "sim": "see a body, its muscles and its learner live in the browser",
    "demo": "a body learns to hop in about two minutes",
    "lab": "TimLab: build diagrams of blocks, run and retune them, in a browser",
    "bench": "the speed table: this library beside bare physics and hand-written loops",
}


def main(arguments: list[str] | None = None) -> int:
    """Run a command; the exit status: 0 done, 2 refused what was asked, 130 stopped by Ctrl-C or SIGTERM."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(_help())
        return 0
    if arguments[0] in ("-V", "--version"):
        from motorgrad import __version__

        print(f"motorgrad {__version__}")
        return 0
    name, *rest = arguments
    from motorgrad._errors import choice

    try:
        choice("command", name, COMMANDS)
        with interrupt_when_asked():
            status = _command(name)(rest)
        sys.stdout.flush()
        return status
    except BaseException as error:
        return _answer(name, error)


def _answer(name: str, error: BaseException) -> int:
    """The exit status for what ended a command early, and a line about it."""
    # a library that is interrupted while it is loaded may raise an error of its own
    if isinstance(error, KeyboardInterrupt) or asked():
        print(f"motorgrad {name}: stopped", file=sys.stderr)
        return 130
    if isinstance(error, BrokenPipeError):
        # whoever was reading, such as head, has enough; the interpreter's last flush must not fail
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    if isinstance(error, ValueError | OSError | RuntimeError):
        print(f"motorgrad {name}: {' '.join(str(error).splitlines())}", file=sys.stderr)
        return 2
    raise error


def _command(name: str) -> Callable[[list[str]], int]:
    """Each command lives in a module of its own, so that help and one command do not load what another needs."""
    import importlib

    return importlib.import_module(f"motorgrad._commands.{name}").run


def _help() -> str:
    lines = [f"  {name:<10} {what}" for name, what in COMMANDS.items()]
    return "\n".join(
        [
            "usage: motorgrad COMMAND ...",
            "",
            "Learning motor control by policy gradients: stochastic units, eligibility traces, muscle-driven bodies.",
            "",
            *lines,
            "",
            "motorgrad COMMAND --help says more; motorgrad --version names the version.",
        ]
    )


def run() -> NoReturn:
    """The command line as a process of its own."""
    status = main()
    if status == 130:
        # all is saved, and libraries that were stopped half loaded may crash where they are taken down
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


if __name__ == "__main__":
    run()
