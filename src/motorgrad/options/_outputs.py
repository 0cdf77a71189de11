"""What a file of options may not choose: it may be a stranger's, and is not to replace what others wrote."""

import os
from collections.abc import Callable, Container, Mapping
from pathlib import Path
from typing import Any

from motorgrad._errors import check
from motorgrad._files import read_json

MARK = "motorgrad"
"""The key of the version in every result that a command writes as JSON."""


def check_outputs(cls: type, named: Mapping[str, Any], line: Container[str]) -> None:
    """Refuse paths to write to that a file names, where something is that motorgrad did not write.

    **Arguments:** the command; the options that the file `named`; the names of those on the command `line`.

    **Raises** `ValueError` that names the option.
    """
    for name, is_ours in OUTPUTS.items():
        if name not in named or name in line or name in getattr(cls, "opened", ()):
            continue
        for path in named[name] if isinstance(named[name], tuple) else (named[name],):
            if isinstance(path, Path) and str(path) != "-" and os.path.lexists(path):
                check(is_ours(path), name, str(path), _allowed(name))


def check_figure(options: Any, named: Mapping[str, Any], line: Container[str]) -> None:
    """`check_outputs` for a figure, which is a file in the folder `out`, or has an ending that is added."""
    if named.get("out") is not None and "out" not in line and hasattr(options, "figure"):
        check(not os.path.lexists(options.figure), "out", str(options.figure), _allowed("out"))


def _allowed(name: str) -> str:
    flag = f"--{name.replace('_', '-')}"
    return f"new, or written by motorgrad, where a file names it; {flag} on the command line replaces it"


def _is_result(path: Path) -> bool:
    try:
        found = read_json(path)
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and isinstance(found.get(MARK), str)


def _is_folder_of_ours(path: Path) -> bool:
    """Whether a folder is empty, or that of a run, of a study or of reproductions. Each checks more when it begins."""
    if not path.is_dir():
        return False
    names = [name for name in os.listdir(path) if not name.startswith(".")]
    made = {"config.toml", "study.toml", "comparison.toml", "checkpoint"} & set(names)
    return bool(made) or all(name == "trained" or (path / name / "config.toml").is_file() for name in names)


def _never(path: Path) -> bool:
    """Nobody can tell who made a film or a figure."""
    del path
    return False


OUTPUTS: dict[str, Callable[[Path], bool]] = {
    "out": _is_folder_of_ours,
    "json": _is_result,
    "record": _never,
    "table": _never,
    "video": _never,
    "animate": _never,
    "tensorboard": _never,
    "file": _never,
    # the run starts with what is there, which must be a saved policy
    "autosave": Path.is_file,
}
"""The options that name what is written, and whether what is there is ours. A command that reads or opens one of them
instead lists it in `opened`."""
