"""Parts: modules whose numbers are leaves and whose structure is static, and the registry of their kinds.

A learner is one tree of such modules. Everything that describes it is derived from the tree: options and TOML keys are
paths of fields, a saved configuration is the tree as a table, and the numbers that may differ by seed or change while
a learner runs are its leaves.
"""

import dataclasses
import functools
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer

from motorgrad._errors import check, is_number, shown, unknown
from motorgrad.schema._declare import Declared, Range, declared_by, inherit_declarations
from motorgrad.schema._texts import with_fields


class Part(eqx.Module):
    """A part of a learner: an equinox module whose numbers are leaves and whose structure is static.

    Declare fields with `number`, `count`, `static` and `inner`. A part checks its own values
    when it is built and lets JAX tracers pass. Absent parts are `None`.

    A part that is registered (`motorgrad.learning.register`) can be chosen by name on the command line and in TOML.
    """

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        inherit_declarations(cls)
        with_fields(cls)

    def __check_init__(self) -> None:
        for name, field in fields_of(type(self)).items():
            check_part_field(self, name, field)
        type(self).validate(self)  # equinox makes a module of every bound method, which takes its time

    def validate(self) -> None:
        """Refuse values that do not go together. It is called once every field has passed its own check."""

    @classmethod
    def kinds(cls) -> dict[str, type["Part"]]:
        """The registered parts that may stand where a `cls` is wanted, by name."""
        if cls in PART_CLASSES:
            return PART_CLASSES[cls]
        kinds = (each for kinds in PART_CLASSES.values() for each in kinds.items())
        return {name: kind for name, kind in kinds if issubclass(kind, cls)}


PART_CLASSES: dict[type, dict[str, Any]] = {}
"""The registry: for every kind of part, the classes that may take its place, by name."""


def register(base: type[Part], name: str, part: type[Part]) -> None:
    """Give a part of your own a name, by which options, TOML files and saved runs know it: a part of a learner, or a
    term of a composed task.

    **Arguments:** the `base` class that it derives from, such as `Trace`, `Baseline` or `Quantity`; the `name`; the
    class.

    **Raises:** `ValueError` for a base without a registry, a name that is taken, or a class that does not derive from
    `base`.

    ```python
    mg.learning.register(mg.learning.Trace, "my-trace", MyTrace)
    ```
    """
    check(base in PART_CLASSES, "base", base, f"one of {', '.join(sorted(cls.__name__ for cls in PART_CLASSES))}")
    check(isinstance(part, type) and issubclass(part, base), "part", part, f"a class that derives from {base.__name__}")
    taken = PART_CLASSES[base].get(name, part)
    check(taken is part, "name", name, f"another name: it is that of {getattr(taken, '__name__', taken)}")
    PART_CLASSES[base][name] = part


def kind_of(part: Part) -> str:
    """The registered name of a part's class; its full name in Python where it is not registered."""
    for kinds in PART_CLASSES.values():
        for name, cls in kinds.items():
            if cls is type(part):
                return name
    return f"{type(part).__module__}.{type(part).__qualname__}"


def fields_of(cls: Any) -> dict[str, dataclasses.Field[Any]]:
    """The fields of a dataclass that its constructor takes, by name."""
    return {field.name: field for field in dataclasses.fields(cls) if field.init}


@functools.cache
def hints_of(cls: type) -> dict[str, Any]:
    """The types of a class's fields, without the names that only type checkers know."""
    return typing.get_type_hints(cls)


def options_of(hint: object) -> tuple[Any, ...]:
    """The members of a union, or the type itself."""
    return typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else (hint,)


def parts_in(hint: object) -> tuple[type[Part], ...]:
    """The kinds of part that a field of this type may hold."""
    return tuple(option for option in options_of(hint) if isinstance(option, type) and issubclass(option, Part))


def is_tracer(value: object) -> bool:
    """Whether a value is not known until a compiled function runs."""
    return isinstance(value, Tracer)


def check_part_field(part: Part, name: str, field: dataclasses.Field[Any]) -> None:
    """Refuse a value of a field of a part that its type or its declaration does not allow."""
    value = object.__getattribute__(part, name)
    if is_tracer(value) or isinstance(value, jax.Array):
        return
    hint = hints_of(type(part))[name]
    options = options_of(hint)
    if value is None and type(None) in options:
        return
    declared = declared_by(field)
    listed = isinstance(value, tuple) and any(typing.get_origin(option) is tuple for option in options)
    if listed and declared.range is not None:
        for place, item in enumerate(typing.cast(tuple[Any, ...], value)):
            declared.check(f"{name}[{place}]", item)
    elif declared.range is not None and declared.range.whole:
        words = _words_of(options)
        whole = isinstance(value, int) and not isinstance(value, bool) and declared.range.allows(value)
        allowed = [declared.instead_of(value), *map(shown, words), *(["None"] if type(None) in options else [])]
        check(whole or value in words, name, value, " or ".join(allowed))
    elif declared.range is not None:
        _check_number(name, value, declared, options)
    elif typing.get_origin(hint) is typing.Literal:
        if value not in typing.get_args(hint):
            raise unknown(name, value, map(str, typing.get_args(hint)))
    elif hint is bool:
        check(isinstance(value, bool), name, value, "True or False")
    elif hint is float:
        check(not isinstance(value, bool) and Range().allows(value), name, value, str(Range()))
    elif kinds := parts_in(hint):
        wanted = " or ".join(with_article(kind.__name__) for kind in kinds)
        wanted = f"None or {wanted}" if type(None) in options else wanted
        functions = Any in options or any(typing.get_origin(option) is Callable for option in options)
        check(functions or isinstance(value, kinds), name, value, wanted)


def _check_number(name: str, value: object, declared: Declared, options: tuple[Any, ...]) -> None:
    allowed = declared.range or Range()
    schedules = parts_in(typing.Union[options])  # noqa: UP007
    if schedules and isinstance(value, schedules):
        return
    if declared.groups and isinstance(value, Mapping):
        for group, item in value.items():
            fine = is_tracer(item) or isinstance(item, jax.Array) or allowed.allows(item)
            check(fine, f"{name}.{group}", item, f"{declared.allowed}, or an array of such numbers")
        return
    single = is_number(value) or (declared.groups and isinstance(value, np.ndarray))
    words = declared.allowed
    if type(None) in options:
        words = f"None or {words}"
    if schedules:
        words = f"{words}, or {' or '.join(with_article(kind.__name__) for kind in schedules)}"
    if declared.groups:
        words = f"{words}, or a mapping from groups of parameters to such numbers"
    check(single and allowed.allows(value), name, value, words)


def _words_of(options: tuple[Any, ...]) -> list[Any]:
    """The values of the `Literal` types among the options of a type."""
    literals = [option for option in options if typing.get_origin(option) is typing.Literal]
    return [word for literal in literals for word in typing.get_args(literal)]


def with_article(name: str) -> str:
    """A name with its article."""
    return f"{'an' if name[:1] in 'AEIOU' else 'a'} {name}"
