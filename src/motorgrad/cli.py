"""The command line. Every command is a typed dataclass and one call of the library."""

import io
import os
import re
import sys
import warnings
from typing import Any, NoReturn

from motorgrad._collection import collecting_seldom
from motorgrad._consent import allow, allow_words
from motorgrad._errors import NotTrusted, plain, shown_path
from motorgrad._processes import IMPORTED, SAFE
from motorgrad._signals import asked, interrupt_when_asked
from motorgrad.commands import COMMANDS, command_named


def main(arguments: list[str] | None = None) -> int:
    """Run a command. Returns the exit status: 0 done, 2 bad input, 130 stopped by Ctrl-C, SIGTERM or SIGHUP."""
    arguments = sys.argv[1:] if arguments is None else arguments
    name = "--import"
    try:
        arguments = _after_imports(arguments)
        allow_words(arguments)
        name, *rest = arguments or ["--help"]
        if name in ("-h", "--help", "help"):
            print(_help())
            status = 0
        elif name in ("-V", "--version"):
            from motorgrad import __version__

            print(f"motorgrad {__version__}")
            status = 0
        else:
            with interrupt_when_asked(), collecting_seldom():
                status = _run(name, rest)
        sys.stdout.flush()
        return status
    except BaseException as error:
        return _answer(name, error)


def _run(name: str, rest: list[str]) -> int:
    """Run a command. Where it would run code that a file names, ask at a terminal."""
    while True:
        try:
            return command_named(name)(rest)
        except NotTrusted as error:
            if not (error.names and sys.stdin.isatty() and sys.stderr.isatty()):
                raise
            print(f"motorgrad {plain(name)}: {plain(error)}", file=sys.stderr)
            print("Run it? [y/N] ", end="", file=sys.stderr, flush=True)
            if sys.stdin.readline().strip().lower() not in ("y", "yes"):
                return 2
            allow(error.names)  # these alone: what else the files name is asked for in turn


def _after_imports(arguments: list[str]) -> list[str]:
    """Import the modules that `--import` names, before or after the command. Returns the other arguments."""
    IMPORTED.clear()  # what an earlier command of this process named is not of this one
    words = iter(arguments)
    left = []
    for word in words:
        flag, equals, name = word.partition("=")
        if flag == "--import":
            _import(name if equals else next(words, ""))
        else:
            left.append(word)
    return left


def _import(name: str) -> None:
    """Import a module of the user's: a file, an installed module or one of the working folder. Only for the last is the
    working folder looked in, as it may hold what other libraries try to import."""
    import importlib.util
    from pathlib import Path

    if not name:
        raise ValueError("--import needs the name of a module")
    if name.endswith(".py"):
        if not Path(name).is_file():
            raise ValueError(f"cannot import {name!r}: there is no such file")
        file = Path(name).resolve()
        found = sys.modules.get(file.stem)
        if found is not None and Path(getattr(found, "__file__", None) or "").resolve() != file:
            raise ValueError(f"cannot import {name!r}: another module of this name is loaded, rename the file")
        _look_in(str(file.parent))
        name = file.stem
        found = importlib.util.find_spec(file.stem)
        if found is None or Path(found.origin or "").resolve() != file:
            raise ValueError(f"cannot import {name!r}: another module of this name is installed, rename the file")
    elif not all(map(str.isidentifier, name.split("."))):
        raise ValueError(f"cannot import {name!r}: must be the name of a module, or of a file that ends in .py")
    elif importlib.util.find_spec(name.partition(".")[0]) is None:
        _look_in("")
    try:
        importlib.import_module(name)
    except ImportError as error:
        raise ValueError(f"cannot import {name!r}: {error}") from error
    IMPORTED.append(name)


def _look_in(folder: str) -> None:
    """Find modules in a folder; last, so that no file there takes the place of another module."""
    if folder not in sys.path:
        sys.path.append(folder)


def _answer(name: str, error: BaseException) -> int:
    """Report the error that ended a command, on one line. Returns the exit status."""
    # a library that is interrupted while it loads may raise another error
    if isinstance(error, KeyboardInterrupt) or asked():
        message = plain(error) if isinstance(error, KeyboardInterrupt) else ""
        print(f"motorgrad {name}: {message or 'stopped'}", file=sys.stderr)
        return 130
    if isinstance(error, BrokenPipeError):
        # the reader, such as head, has closed the pipe; the last flush of the interpreter must not fail
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    if isinstance(error, ValueError | OSError | RuntimeError):
        words: Any = error
        if isinstance(error, OSError) and error.filename is not None and error.strerror:
            words = f"{shown_path(error.filename)}: {error.strerror}"
        message = "; ".join(map(plain, (words, *getattr(error, "__notes__", ()))))
        print(f"motorgrad {plain(name)}: {message}", file=sys.stderr)
        return 2
    raise error


def _help() -> str:
    from motorgrad._applications import OFFERED_COMMANDS, entries

    lines = [f"  {name:<10} {what}" for name, what in COMMANDS.items()]
    others = {name: offer for name, offer in entries(OFFERED_COMMANDS).items() if name not in COMMANDS}
    lines += [f"  {name:<10} of the package {offer.dist.name}" for name, offer in others.items() if offer.dist]
    return "\n".join(
        [
            "usage: motorgrad [--import MODULE] COMMAND ...",
            "",
            "Learning motor control by policy gradients: stochastic units, eligibility traces, muscle-driven bodies.",
            "",
            *lines,
            "",
            "motorgrad COMMAND --help shows the options of a command; motorgrad --version the version.",
            "--import MODULE imports a module or a file (.py) first, so that what it registers is known by name:",
            "tasks, parts, blocks.",
        ]
    )


def _warn(message: Warning | str, *_: object, **__: object) -> None:
    """Show a warning as one line, without the place in the code and without colours."""
    words = " ".join(re.sub("\x1b\\[[0-9;]*m", "", str(message)).split())
    print(f"motorgrad: warning: {plain(words.removeprefix('WARN: '))}", file=sys.stderr)


def run() -> NoReturn:
    """Run the command line as a process."""
    os.environ.update(SAFE)
    warnings.showwarning = _warn
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of files need not be text
    status = main()
    if status:
        from motorgrad._program_store import end

        # everything is saved, and libraries whose threads are still starting may abort the process at exit
        sys.stdout.flush()
        sys.stderr.flush()
        end()
        os._exit(status)
    sys.exit(status)


if __name__ == "__main__":
    run()
