"""Options from a TOML file and the command line: one mechanism for every command.

A command is a frozen dataclass of `Settings`. Its fields are its options, and the keys of its file; a field that is a
dataclass is a table. `effective()` returns what `--check` prints, where that is not the plain table of the fields.
"""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import tomli_w

from motorgrad._errors import check, unknown
from motorgrad._files import check_writable, read_toml
from motorgrad.options._line import HELP, HELP_ALL, flag_of, nested, read_line
from motorgrad.options._outputs import check_figure, check_outputs
from motorgrad.schema import Words, build, convert, deeper, fields_of, table

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

ASKED = ("trust", "allow_changed", "host")
"""Options that a file cannot give: whether to trust it, and who can reach the page. `_outputs` limits others."""


class Arguments(NamedTuple):
    """The arguments of a command before its options are known.

    - `file` and `table`: the TOML file and its content.
    - `check`: whether only to check.
    - `rest`: the words that are left to read.
    - `line`: what they say, once they are read (`read_line`).
    """

    file: Path | None
    table: dict[str, Any]
    check: bool
    rest: list[str]
    line: dict[str, Words] | None = None


def parse(cls: type[T], arguments: Sequence[str], prog: str) -> T:
    """Make the dataclass `cls` from the file that `--config` names and from the command line, which overrides it.

    With `--check`, print it as TOML and exit.

    **Raises** `ValueError` that names the file and the setting, for a file that cannot be read, for unknown settings
    and options and for impossible values.
    """
    return resolve(cls, read_arguments(arguments), prog)


def read_arguments(arguments: Sequence[str]) -> Arguments:
    """Take `--config FILE` and `--check` from the command line, and read the file."""
    name, rest = pop_option("config", arguments)
    file = None if name is None else Path(name)
    left = [argument for argument in rest if argument != "--check"]
    return Arguments(file, {} if file is None else read_toml(file), left != rest, left)


def pop_option(option: str, arguments: Sequence[str]) -> tuple[str | None, list[str]]:
    """The value of one option, and the arguments without it."""
    flag = f"--{option}"
    value = None
    rest = []
    left = list(arguments)
    while left:
        argument, *left = left
        if argument != flag and not argument.startswith(f"{flag}="):
            rest.append(argument)
            continue
        check(value is None, flag, value, "given once")
        if argument == flag and not left:
            raise ValueError(f"{flag}: must be followed by a path")
        value, left = (left[0], left[1:]) if argument == flag else (argument.partition("=")[2], left)
    return value, rest


def resolve(cls: type[T], given: Arguments, prog: str) -> T:
    """As `parse`, for arguments that `read_arguments` returned."""
    if asked := {*HELP, HELP_ALL} & set(given.rest):
        from motorgrad.options._help import help_text  # which is not needed to run

        only = None if HELP_ALL in asked else getattr(cls, "common", None)
        print(help_text(cls, prog, only))
        raise SystemExit(0)
    for name in ASKED:
        check(name not in given.table, f"{given.file}: {name}", given.table.get(name), "an option of the command line")
    line = read_line(cls, given.rest) if given.line is None else given.line
    known = fields_of(cls)
    for path in line:
        if path.partition(".")[0] not in known:
            raise unknown("option", flag_of(path), [flag_of(name) for name in known], map(flag_of, deeper(cls, path)))
    with naming(given.file):
        in_file = convert(cls, given.table)
        check_outputs(cls, in_file, line)
    with naming(given.file, given.rest):
        options = build(cls, _over(given.table, nested(line)))
        check_figure(options, in_file, line)
        if (json := getattr(options, "json", None)) and str(json) != "-":
            check_writable("json", json)
    if given.check:
        values = getattr(options, "effective", lambda: table(options))()
        print(tomli_w.dumps({name: value for name, value in values.items() if name not in ASKED}), end="")
        raise SystemExit(0)
    return options


@contextlib.contextmanager
def naming(file: Path | None, words: Sequence[str] = ()) -> Iterator[None]:
    """Let a `ValueError` begin with the file that the options come from, and the words with it, unless it does."""
    try:
        yield
    except ValueError as error:
        source = " ".join([str(file), *(["with", *words] if words else [])])
        named = file is None or str(error).startswith(str(file))
        raise ValueError(str(error) if named else f"{source}: {error}") from None


def _over(file: Mapping[str, Any], line: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a file with that of the command line over it, and likewise the tables within."""
    both = {
        name: _over(file[name], line[name])
        for name in line
        if isinstance(file.get(name), Mapping) and isinstance(line[name], Mapping)
    }
    return {**file, **line, **both}
