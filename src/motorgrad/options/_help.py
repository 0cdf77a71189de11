"""The help of a command: its arguments and options, those of a task and a learner too, as their fields declare them."""

import dataclasses
import shutil
import textwrap
import types
import typing
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from motorgrad.options._line import flag_of
from motorgrad.schema import (
    PART_CLASSES,
    Declared,
    Part,
    declared_by,
    default_of,
    description_of,
    descriptions,
    fields_of,
    hints_of,
    kind_of,
    name_in_words,
    options_of,
    parts_in,
)

COLUMN = 26  # characters, where the texts begin
USUAL_WIDTH = 100  # where there is no terminal
SCALARS = {int: "INT", float: "FLOAT", str: "STR", Path: "PATH"}
COMMON = (
    ("-h, --help", "", "Show this help and exit."),
    ("--config", "PATH", "A TOML file of options. The command line overrides it."),
    ("--check", "", "Only check the options, and print them as TOML."),
)


class Option(NamedTuple):
    """An option: its path, the type of its value, its default (`dataclasses.MISSING` if it must be given), its text,
    and what its field declares."""

    path: str
    hint: Any
    default: Any
    text: str
    declared: Declared = Declared()

    @property
    def flag(self) -> str:
        """The option as one types it: `--agent.decay`; of a flag that is on, also what turns it off."""
        *outer, name = self.path.split(".")
        off = f", {flag_of('.'.join([*outer, f'no_{name}']))}" if self.default is True else ""
        return f"{flag_of(self.path)}{off}"

    @property
    def group(self) -> str:
        """The path of the thing that it is a setting of, empty for the command itself."""
        return self.path.rpartition(".")[0]


def help_text(cls: type, prog: str, only: Container[str] | None = None) -> str:
    """The help of a command whose options are the fields of `cls`; of those, `only` some where the rest is too long."""
    known = list(_of_dataclass(cls, None, ""))
    arguments = [option for option in known if option.declared.positional]
    shown = " ".join(option.declared.positional for option in arguments)
    usage = f"usage: motorgrad {prog} [-h] [OPTIONS] {shown}".rstrip()
    lines = [usage, "", *(_wrapped(each) for each in description_of(cls).split("\n\n")), ""]
    if arguments:
        lines.append("arguments:")
        for option in arguments:
            lines += _entry(option.declared.positional, "", f"{option.text}{_details(option)}")
        lines.append("")
    groups: dict[str, list[Option]] = {"": []}
    for option in known:
        if not option.declared.positional and (only is None or option.path in only):
            groups.setdefault(option.group, []).append(option)
    for group, members in groups.items():
        lines.append(f"options of {group}:" if group else "options:")
        for flag, metavar, text in () if group else COMMON:
            lines += _entry(flag, metavar, text)
        for option in members:
            metavar = option.declared.metavar or metavar_of(option.hint)
            lines += _entry(option.flag, metavar, f"{option.text}{_details(option)}")
        lines.append("")
    return "\n".join(lines)


def metavar_of(hint: Any) -> str:
    """What the help shows for a value: INT, {a,b}, FLOAT | NAME VALUE ...; nothing for a flag."""
    found = []
    options = options_of(hint)
    for option in options:
        origin = typing.get_origin(option)
        inner = typing.get_args(option)
        if option is bool:
            found += ["{true,false}"] if len(options) > 1 else []
        elif origin is Literal:
            found.append("{" + ",".join(map(str, inner)) + "}")
        elif origin is tuple:
            many = inner[1:] == (Ellipsis,)
            found.append(" ".join([metavar_of(each) for each in (inner[:1] if many else inner)] + ["..."] * many))
        elif parts_in(option):
            names = _names(option)
            found += ["{" + ",".join(names) + "}"] if names else []
        elif origin is not None:
            found.append("NAME VALUE ...")
        elif option is not types.NoneType:
            found.append(SCALARS.get(option, "VALUE"))
    return " | ".join(word for word in dict.fromkeys(filter(None, found)) if f"{word} ..." not in found)


def _of_dataclass(cls: type, instance: Any, path: str) -> Iterator[Option]:
    """The options of a dataclass, and of those within it, whose values in the `instance` are the defaults."""
    texts = descriptions(cls, units=False)
    hints = hints_of(cls)
    for name, field in fields_of(cls).items():
        default = default_of(field) if instance is None else getattr(instance, name)
        place = f"{path}.{name}" if path else name
        declared = declared_by(field)
        if not declared.option:  # too much for a command line: it is given in a file
            continue
        if isinstance(default, Part):
            yield from _of_part(default, place)
        elif dataclasses.is_dataclass(default) and not isinstance(default, type):
            yield from _of_dataclass(type(default), default, place)
        else:
            yield Option(place, hints[name], default, texts.get(name, ""), declared)


def _of_part(part: Part, path: str, optional: bool = False) -> Iterator[Option]:
    """The options of a part of a learner and of the parts within it; first its kind, where there are several."""
    cls = type(part)
    family = next(((base, kinds) for base, kinds in PART_CLASSES.items() if cls in kinds.values()), None)
    if family is not None and len(family[1]) > 1:
        base, kinds = family
        keeps = "keeps the policy" if hasattr(base, "aliases") else "starts from its own defaults"
        names = [*(["none"] if optional else []), *kinds]
        text = f"The kind of {name_in_words(base)}. Another kind {keeps}."
        yield Option(f"{path}.kind", Literal[tuple(names)], kind_of(part), text)
    texts = descriptions(cls, units=False)
    for name, field in fields_of(cls).items():
        hint = hints_of(cls)[name]
        value = getattr(part, name)
        place = f"{path}.{name}"
        text = texts.get(name, "")
        if isinstance(value, Part):
            yield from _of_part(value, place, types.NoneType in options_of(hint))
        elif name == "transformations" and not value:
            continue
        elif parts_in(hint) and float not in options_of(hint):  # absent: a choice among the kinds
            yield Option(place, Literal[(*("none", *_names(hint)),)], "none", text)
        else:
            plain = tuple(option for option in options_of(hint) if not parts_in(option))  # a number may be annealed
            default = np.asarray(value).tolist() if np.ndim(value) else value
            yield Option(place, typing.Union[plain], default, text, declared_by(field))  # noqa: UP007


def _names(hint: Any) -> list[str]:
    """The names of the kinds that a field of this type may hold."""
    return [name for kind in parts_in(hint) for name in (*kind.kinds(), *getattr(kind, "presets", {}))]


def _details(option: Option) -> str:
    """What leaving an option out gives, its unit and its range, in parentheses: " (default: 30 s, at least 0)"."""
    default = option.default
    unit = option.declared.unit
    ends = "" if option.declared.range is None else option.declared.range.ends
    if default is dataclasses.MISSING:
        found = ["required", unit and f"in {unit}", ends]
    elif isinstance(default, bool) or default is None or (isinstance(default, str | tuple) and not default):
        found = [unit and f"in {unit}", ends]
    else:
        found = [f"default: {_in_words(default)} {unit}".rstrip(), ends]
    said = ", ".join(filter(None, found))
    return f" ({said})" if said else ""


def _in_words(default: Any) -> str:
    """A value as the words that one would type."""
    if isinstance(default, dict):
        return " ".join(f"{name} {value}" for name, value in default.items())
    if isinstance(default, tuple | list):
        return " ".join(map(_in_words, default))
    return str(int(default) if isinstance(default, float) and default.is_integer() else default)


def _entry(flag: str, metavar: str, text: str) -> list[str]:
    """The lines of an option: flag and value, then the text, beside them where there is room."""
    head = f"  {flag} {metavar}".rstrip()
    width = shutil.get_terminal_size((USUAL_WIDTH, 24)).columns
    lines = textwrap.wrap(" ".join(text.split()), max(20, width - COLUMN), break_on_hyphens=False) or [""]
    indent = " " * COLUMN
    if len(head) < COLUMN - 1:
        return [f"{head:<{COLUMN}}{lines[0]}".rstrip(), *(f"{indent}{line}" for line in lines[1:])]
    return [head, *(f"{indent}{line}" for line in lines)]


def _wrapped(paragraph: str) -> str:
    """A paragraph in the width of the terminal, with an empty line after it."""
    width = shutil.get_terminal_size((USUAL_WIDTH, 24)).columns
    return textwrap.fill(" ".join(paragraph.split()), width, break_on_hyphens=False) + "\n"
