"""Options from a TOML file and the command line: one mechanism for every command.

A command is a frozen dataclass. Its fields are its options, and the keys of its file; a field that is a dataclass is a
table. `validate()` checks the options before any work. `effective()` returns what `--check` prints, where that is not
the plain table of the fields.
"""

import contextlib
import dataclasses
import inspect
import re
import typing
from collections.abc import Container, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar

import numpy as np
import tomli_w
import tyro

from motorgrad._docstrings import attribute_texts, description_of, descriptions
from motorgrad._errors import check
from motorgrad._files import check_writable, read_toml
from motorgrad._settings import build, convert, default_of, table
from motorgrad._tree import PART_CLASSES, Part, fields_of, hints_of, kind_of, options_of, parts_in
from motorgrad.options._outputs import check_outputs
from motorgrad.options._words import REGISTRY, reader, shown_as
from motorgrad.policies import INITIAL
from motorgrad.training import policy_settings

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")
COMMON: list[Any] = [
    (
        "config",
        Annotated[
            Path | None,
            tyro.conf.arg(
                help="A TOML file of options. The command line overrides it.", metavar="PATH", help_behavior_hint=""
            ),
        ],
        None,
    ),
    (
        "check",
        Annotated[
            tyro.conf.FlagCreatePairsOff[bool], tyro.conf.arg(help="Only check the options, and print them as TOML.")
        ],
        False,
    ),
]


HELP = {"-h", "--help"}
HELP_ALL = "--help-all"

ASKED = ("trust", "allow_changed", "host")
"""Options that a file cannot give: whether to trust it, and who can reach the page. `_outputs` limits others."""


class Arguments(NamedTuple):
    """The arguments of a command before its options are known.

    - `file` and `table`: the TOML file and its content.
    - `check`: whether only to check.
    - `rest`: the words that are left to parse.
    """

    file: Path | None
    table: dict[str, Any]
    check: bool
    rest: list[str]


def parse(cls: type[T], arguments: Sequence[str], prog: str) -> T:
    """Make the dataclass `cls` from the file that `--config` names and from the command line, which overrides it.

    With `--check`, print it as TOML and exit.

    **Raises** `ValueError` that names the file and the setting, for a file that cannot be read and for unknown settings
    and impossible values; `SystemExit` with status 2 for unknown options.
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
    values = parse_values(cls, given, prog)
    try:
        check_outputs(cls, convert(cls, given.table), values, given.rest)
        options = build(cls, values)
        getattr(options, "validate", lambda: None)()
        if (json := getattr(options, "json", None)) and str(json) != "-":
            check_writable("json", json)
    except ValueError as error:
        source = " ".join([str(given.file), *(["with", *given.rest] if given.rest else [])])
        raise ValueError(f"{source}: {error}" if given.file else str(error)) from None
    if given.check:
        values = getattr(options, "effective", lambda: table(options))()
        print(tomli_w.dumps({name: value for name, value in values.items() if name not in ASKED}), end="")
        raise SystemExit(0)
    return options


@contextlib.contextmanager
def naming(file: Path | None) -> Iterator[None]:
    """Let a `ValueError` begin with the file that the options come from, unless it names it."""
    try:
        yield
    except ValueError as error:
        message = str(error)
        raise ValueError(message if file is None or str(file) in message else f"{file}: {message}") from None


def parse_values(cls: type, given: Arguments, prog: str) -> dict[str, Any]:
    """The values of the given options, each converted to its type. Nothing else is checked yet."""
    for name in ASKED:
        check(name not in given.table, f"{given.file}: {name}", given.table.get(name), "an option of the command line")
    try:
        values = convert(cls, given.table)
    except ValueError as error:
        raise ValueError(f"{given.file}: {error}") from None
    if not given.rest:  # a form with all options takes a while to make
        return values
    common = getattr(cls, "common", ())
    only = {*common, *(name for name, *_ in COMMON)} if common and HELP & set(given.rest) else None
    form = _form(cls, values, COMMON, only)
    rest = ["--help" if word == HELP_ALL else word for word in given.rest]
    return _values(tyro.cli(form, args=rest, prog=f"motorgrad {prog}", registry=REGISTRY), cls)


def _values(form: Any, cls: type) -> dict[str, Any]:
    """The values of a form as nested tables."""
    names = [field.name for field in dataclasses.fields(form)] if issubclass(cls, _PartForm) else fields_of(cls)
    values = {name: getattr(form, name) for name in names}
    return {
        name: _values(value, type(value)) if dataclasses.is_dataclass(value) else value
        for name, value in values.items()
    }


def _form(cls: type, values: Mapping[str, Any], more: Sequence[Any] = (), only: Container[str] | None = None) -> Any:
    """`cls` as tyro shows it: with these defaults and help for every field, and without its checks.

    **Arguments:** `more` entries; the `only` fields that the help shows, by default all.
    """
    hints = typing.get_type_hints(cls, include_extras=True)
    entries = []
    helps = {**attribute_texts(cls), **descriptions(cls)}
    for name, field in fields_of(cls).items():
        hint = hints[name]
        default = values[name] if name in values else default_of(field)
        if field.metadata.get("option") is False:  # too much for a command line: it is given in a file
            fixed = Annotated[Any, tyro.conf.Fixed, tyro.conf.Suppress]
            entries.append((name, fixed, dataclasses.field(default_factory=lambda value=default: value)))
            continue
        if isinstance(default, Part):
            hint = part_form(default)
            default = hint()
        elif dataclasses.is_dataclass(default):
            hint = _form(type(default), {inner: getattr(default, inner) for inner in fields_of(type(default))})
            default = hint()
        hint, *default_of_field = _entry(hint, default, helps.get(name))
        shown = only is None or name in only
        entries.append((name, hint if shown else Annotated[hint, tyro.conf.Suppress], *default_of_field))
    space = {"__doc__": description_of(cls), "__post_init__": lambda self: None}
    frozen = cls.__dataclass_params__.frozen  # type: ignore[attr-defined]
    return dataclasses.make_dataclass(
        cls.__name__, [*entries, *more], bases=(cls,), namespace=space, frozen=frozen, kw_only=True
    )


class _PartForm:
    """The options of a part of a learner, or of an initial policy."""


def part_form(part: Part, optional: bool = False) -> Any:
    """The options of a part of a learner and of the parts within it, with their present values as defaults.

    `optional` says whether the part may be absent.
    """
    cls = type(part)
    entries = []
    helps = descriptions(cls)
    hints = hints_of(cls)
    families = [(base, kinds) for base, kinds in PART_CLASSES.items() if cls in kinds.values() and len(kinds) > 1]
    if families:
        family, kinds = families[0]
        keeps = "keeps the settings that both have" if hasattr(family, "aliases") else "starts from its own defaults"
        about = f"The kind of {name_in_words(family)}. Another kind {keeps}."
        kind: Any = typing.Literal[(*(["none"] if optional else []), *kinds)]
        entries.append(("kind", *_entry(kind, kind_of(part), about)))
    for name in fields_of(cls):
        value = getattr(part, name)
        hint = hints[name]
        if name == "transformations" and not value:
            continue
        if hasattr(value, "as_setting"):
            hint = policy_form(value.kind, value.settings)
            value = hint()
        else:
            if isinstance(value, Part) or parts_in(hint):
                hint, value = _part_option(hint, value)
            if np.ndim(value):
                value = tuple(np.asarray(value).tolist())
        entries.append((name, *_entry(hint, value, helps.get(name))))
    space = {"__doc__": description_of(cls)}
    return dataclasses.make_dataclass(cls.__name__, entries, bases=(_PartForm,), namespace=space)


def name_in_words(cls: type) -> str:
    """The name of a class in words, such as "critic fit"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", cls.__name__).lower()


def _part_option(hint: object, value: object) -> tuple[Any, Any]:
    """The type and the default of the option for a field that holds a part: a table of the part's own options; where it
    is absent, a choice among the kinds."""
    if isinstance(value, Part):
        form = part_form(value, type(None) in options_of(hint))
        return form, form()
    if float in options_of(hint):  # a number may be annealed
        return typing.Union[tuple(option for option in options_of(hint) if not parts_in(option))], value  # noqa: UP007
    names = [name for kind in parts_in(hint) for name in (*kind.kinds(), *getattr(kind, "presets", {}))]
    return typing.Literal[("none", *names)], "none"


def policy_form(kind: str, settings: Mapping[str, Any]) -> Any:
    """The options of an initial policy of a kind, with these settings as defaults."""
    function = INITIAL[kind]
    known = inspect.signature(function).parameters
    entries = [
        (
            "kind",
            *_entry(
                typing.Literal[tuple(INITIAL)],
                kind,
                "The initial policy. Another kind starts from its own defaults.",
            ),
        )
    ]
    helps = descriptions(function)
    for name, hint in policy_settings(kind).items():
        value = settings.get(name, known[name].default)
        if parts_in(hint):
            hint, value = _part_option(hint, value)
        entries.append((name, *_entry(hint, value, helps.get(name))))
    doc = (inspect.getdoc(function) or "").partition("\n")[0]
    return dataclasses.make_dataclass("Policy", entries, bases=(_PartForm,), namespace={"__doc__": doc})


def _entry(hint: object, default: object, about: str | None) -> tuple[Any, ...]:
    """The type of an option and its default, as `dataclasses.make_dataclass` takes them after the name."""
    shown = "(required)" if default is dataclasses.MISSING else None  # tyro would show an empty default
    if (default is None and "None" not in (about or "")) or default in ("", ()):
        shown = ""  # the text says what happens by default
    about = about and " ".join(about.split())  # tyro would keep the line breaks
    argument = tyro.conf.arg(help=about, metavar=shown_as(hint, default), help_behavior_hint=shown)
    hint = Annotated[(hint, argument, *reader(hint))]
    given = () if default is dataclasses.MISSING else (dataclasses.field(default_factory=lambda: default),)
    return (hint, *given)
