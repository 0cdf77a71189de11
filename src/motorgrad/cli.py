"""The command line. Thin: every command is a typed dataclass and one call of the library."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

COMMANDS = {
    "list": "every task, policy, estimator and experiment",
    "train": "learn; progress bar; a run directory; goes on where it stopped",
    "evaluate": "a learnt policy without learning: its numbers and a video",
    "plot": "learning curves of one run or of several",
    "reproduce": "figures and claims of the thesis, measured again; a report",
    "demo": "a body learns to hop in about two minutes",
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
        with _terminated_as_interrupted():
            return _command(name)(rest)
    except (ValueError, OSError, RuntimeError) as error:
        print(f"motorgrad {name}: {' '.join(str(error).splitlines())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Make of SIGTERM what Ctrl-C is. Training, which has safe points to stop at, has its own way with both."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    previous = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if previous is None else previous)


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


if __name__ == "__main__":
    sys.exit(main())
