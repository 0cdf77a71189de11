"""Options from a TOML file and the command line: one mechanism for every command.

A command is a frozen dataclass. Its fields are its options, by their names in the file as well; a field that is a
dataclass is a table. What its `validate()` refuses is refused before any work; `effective()` may say what to print
for `--check` where it is not the plain table of its fields.
"""

import dataclasses
import inspect
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
import tomli_w
import tyro

from motorgrad._commands._words import REGISTRY, reader, shown_as
from motorgrad._docstrings import description_of, descriptions
from motorgrad._errors import check
from motorgrad._files import check_writable, read_toml
from motorgrad._settings import build, convert, default_of, table
from motorgrad._tree import KINDS, Part, fields_of, hints_of, kind_of, options_of, parts_in
from motorgrad.policies import INITIAL
from motorgrad.training import policy_settings

T = TypeVar("T")
COMMON: list[Any] = [
    (
        "config",
        Annotated[Path | None, tyro.conf.arg(help="A TOML file of options; those on the command line override it.")],
        None,
    ),
    (
        "check",
        Annotated[tyro.conf.FlagCreatePairsOff[bool], tyro.conf.arg(help="Only check, and print the options as TOML.")],
        False,
    ),
]


class Given(NamedTuple):
    """What was asked for, before the options are known: the file and its table, whether only to check, what is left."""

    file: Path | None
    table: dict[str, Any]
    check: bool
    rest: list[str]


def parse(cls: type[T], arguments: Sequence[str], prog: str) -> T:
    """The dataclass `cls` filled from the file that `--config` names, and from the command line, which overrides it.

    With `--check` it is printed as TOML, and the process is done.

    **Raises** `ValueError` for a file that cannot be read, or says what is unknown or impossible, naming it;
    `SystemExit` with status 2 for options that are none.
    """
    return resolve(cls, read(arguments), prog)


def read(arguments: Sequence[str]) -> Given:
    """Take `--config FILE` and `--check` from the command line, and read the file."""
    name, rest = take("config", arguments)
    file = None if name is None else Path(name)
    left = [argument for argument in rest if argument != "--check"]
    return Given(file, {} if file is None else read_toml(file), left != rest, left)


def take(option: str, arguments: Sequence[str]) -> tuple[str | None, list[str]]:
    """The value of one option, and the arguments without it."""
    flag, value, rest, left = f"--{option}", None, [], list(arguments)
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


def resolve(cls: type[T], given: Given, prog: str) -> T:
    """As `parse`, for what `read` gave."""
    values = fill(cls, given, prog)
    try:
        options = build(cls, values)
        getattr(options, "validate", lambda: None)()
        if (json := getattr(options, "json", None)) and str(json) != "-":
            check_writable("json", json)
    except ValueError as error:
        source = " ".join([str(given.file), *(["with", *given.rest] if given.rest else [])])
        raise ValueError(f"{source}: {error}" if given.file else str(error)) from None
    if given.check:
        print(tomli_w.dumps(getattr(options, "effective", lambda: table(options))()), end="")
        raise SystemExit(0)
    return options


def fill(cls: type, given: Given, prog: str) -> dict[str, Any]:
    """The options that were given, each of its type, and nothing else refused yet."""
    try:
        values = convert(cls, given.table)
    except ValueError as error:
        raise ValueError(f"{given.file}: {error}") from None
    if not given.rest:  # a form of all that could be said takes a while to make
        return values
    form = _form(cls, values, COMMON)
    return _values(tyro.cli(form, args=given.rest, prog=f"motorgrad {prog}", registry=REGISTRY), cls)


def _values(form: Any, cls: type) -> dict[str, Any]:
    """A filled form as a table; a form of a part of a learner has entries of its own."""
    names = [field.name for field in dataclasses.fields(form)] if issubclass(cls, _PartForm) else fields_of(cls)
    values = {name: getattr(form, name) for name in names}
    return {
        name: _values(value, type(value)) if dataclasses.is_dataclass(value) else value
        for name, value in values.items()
    }


def _form(cls: type, values: Mapping[str, Any], more: Sequence[Any] = ()) -> Any:
    """`cls` as the command line shows it: these defaults, help for every field, nothing refused yet."""
    hints, helps, entries = typing.get_type_hints(cls, include_extras=True), descriptions(cls), []
    for name, field in fields_of(cls).items():
        hint, default = hints[name], values[name] if name in values else default_of(field)
        if isinstance(default, Part):
            hint = part_form(default)
            default = hint()
        elif dataclasses.is_dataclass(default):
            hint = _form(type(default), {inner: getattr(default, inner) for inner in fields_of(type(default))})
            default = hint()
        entries.append((name, *_entry(hint, default, helps.get(name))))
    space = {"__doc__": description_of(cls), "__post_init__": lambda self: None}
    # a subclass, so that what stands under the fields of `cls` is found as their help
    frozen = cls.__dataclass_params__.frozen  # type: ignore[attr-defined]
    return dataclasses.make_dataclass(
        cls.__name__, [*entries, *more], bases=(cls,), namespace=space, frozen=frozen, kw_only=True
    )


class _PartForm:
    """The options of a part of a learner, or of an initial policy."""


def part_form(part: Part) -> Any:
    """The options of a part of a learner and of the parts within it, with their present values as defaults."""
    cls, entries = type(part), []
    helps, hints = descriptions(cls), hints_of(cls)
    families = [kinds for kinds in KINDS.values() if cls in kinds.values() and len(kinds) > 1]
    if families:
        kind: Any = typing.Literal[tuple(families[0])]
        entries.append(("kind", *_entry(kind, kind_of(part), "Which kind; another kind starts from its own settings.")))
    for name in fields_of(cls):
        value, hint = getattr(part, name), hints[name]
        if name == "transformations" and not value:
            continue
        if hasattr(value, "as_setting"):
            hint = policy_form(value)
            value = hint()
        elif isinstance(value, Part):
            hint = part_form(value)
            value = hint()
        elif kinds := parts_in(hint):
            names = [name for kind in kinds for name in (*kind.kinds(), *getattr(kind, "presets", {}))]
            numeric = float in options_of(hint)
            hint = float | None if numeric else typing.Literal[("none", *names)]
            value = value if numeric else "none"
        elif np.ndim(value):
            value = tuple(value.tolist())
        entries.append((name, *_entry(hint, value, helps.get(name))))
    space = {"__doc__": description_of(cls)}
    return dataclasses.make_dataclass(cls.__name__, entries, bases=(_PartForm,), namespace=space)


def policy_form(policy: Any) -> Any:
    """The options of an initial policy."""
    function = INITIAL[policy.kind]
    known = inspect.signature(function).parameters
    entries = [("kind", *_entry(typing.Literal[tuple(INITIAL)], policy.kind, "The initial policy."))]
    helps = descriptions(function)
    for name, hint in policy_settings(policy.kind).items():
        entries.append((name, *_entry(hint, policy.settings.get(name, known[name].default), helps.get(name))))
    doc = (inspect.getdoc(function) or "").partition("\n")[0]
    return dataclasses.make_dataclass("Policy", entries, bases=(_PartForm,), namespace={"__doc__": doc})


def _entry(hint: Any, default: Any, about: str | None) -> tuple[Any, ...]:
    """The type of an option and its default, as `dataclasses.make_dataclass` takes them after the name."""
    missing = "(required)" if default is dataclasses.MISSING else None  # of no words tyro makes an empty default
    argument = tyro.conf.arg(help=about, metavar=shown_as(hint), help_behavior_hint=missing)
    hint = Annotated[(hint, argument, *reader(hint))]
    given = () if default is dataclasses.MISSING else (dataclasses.field(default_factory=lambda: default),)
    return (hint, *given)
