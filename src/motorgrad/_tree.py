"""Modules whose numbers are leaves and whose structure is static.

A learner is one tree of such modules. Everything that describes it is derived from the tree: options and TOML keys are
paths of fields, a saved configuration is the tree as a table, and the numbers that may differ by seed or change while
a learner runs are its leaves.
"""

import dataclasses
import functools
import math
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jax.core import Tracer
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check, shown, unknown

T = TypeVar("T")


class Range(NamedTuple):
    """The values that a number may take: finite, between `low` and `high`."""

    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False
    open_high: bool = False

    def allows(self, value: object) -> bool:
        """Whether a number, or every number of an array, is finite and within the range."""
        try:
            numbers = np.asarray(value)
        except (TypeError, ValueError):  # lists of different lengths
            return False
        if numbers.dtype.kind not in "iuf" and not jnp.issubdtype(numbers.dtype, jnp.floating):
            return False
        above = numbers > self.low if self.open_low else numbers >= self.low
        below = numbers < self.high if self.open_high else numbers <= self.high
        return bool(np.all(np.isfinite(numbers) & above & below))

    def __str__(self) -> str:
        if math.isinf(self.low) and math.isinf(self.high):
            return "a finite number"
        if math.isinf(self.high):
            return f"a finite number {'above' if self.open_low else 'of at least'} {self.low:g}"
        return f"in {'(' if self.open_low else '['}{self.low:g}, {self.high:g}{')' if self.open_high else ']'}"


def number(
    default: object = dataclasses.MISSING,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    open_low: bool = False,
    open_high: bool = False,
    groups: bool = False,
    at_start: bool = False,
) -> Any:
    """Declare a field that holds a number: a leaf of the tree.

    **Arguments:**

    - `default`: the field's default; a field whose type allows `None` may be absent.
    - `low` and `high`: the range, each end included unless `open_low` or `open_high` says otherwise.
    - `groups`: whether the field also takes a mapping from names of a policy's fields to numbers or arrays. A name may
      be the end of a field's path, such as `movement.weights`.
    - `at_start`: whether it is used only to build the first state, so that changing it during a run has no effect.
    """
    metadata = {"range": Range(low, high, open_low, open_high), "groups": groups, "at_start": at_start}
    given: dict[str, Any] = {} if default is dataclasses.MISSING else {"default": default}
    return eqx.field(converter=_number, metadata=metadata, **given)


def count(default: int | str | None, low: int = 0, high: int = 2**31 - 1) -> Any:
    """Declare a static field that holds a whole number: a length, an interval or a count."""
    return eqx.field(static=True, default=default, metadata={"whole": (low, high)})


def static(default: object, *, kw_only: bool = False) -> Any:
    """Declare a field that is part of the structure: a choice by name, a flag, or a number that fixes a shape.
    `kw_only` as in `dataclasses.field`."""
    if kw_only:
        return eqx.field(static=True, default=default, kw_only=True)
    return eqx.field(static=True, default=default)  # kw_only=False would undo that of a whole class


class Part(eqx.Module):
    """A part of a learner: an equinox module whose numbers are leaves and whose structure is static.

    Declare fields with `number`, `count` and `static`, or by the type of another part. A part checks its own values
    when it is built and lets JAX tracers pass. Absent parts are `None`.

    A part that is registered (`motorgrad.learning.register`) can be chosen by name on the command line and in TOML.
    """

    def __check_init__(self) -> None:
        for name, field in fields_of(type(self)).items():
            _check_field(self, name, field)
        type(self).validate(self)  # equinox makes a module of every bound method, which takes its time

    def validate(self) -> None:
        """Refuse values that do not go together. It is called once every field has passed its own check."""

    @classmethod
    def kinds(cls) -> dict[str, type["Part"]]:
        """The registered parts that may stand where a `cls` is wanted, by name."""
        return PART_CLASSES.get(cls, {})


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


class Numbers:
    """The numbers of a tree of parts as one vector, and the way back.

    A compiled function takes the vector, so one program serves all values, which may differ by seed.

    **Arguments:** a `tree` of parts, whose leaves are numbers or arrays of numbers.
    """

    def __init__(self, tree: PyTree):
        found, self._structure = jax.tree_util.tree_flatten_with_path(tree)
        self.paths = [path_of(place) for place, _ in found]
        self._shapes = [np.shape(leaf) for _, leaf in found]
        self._ends = np.cumsum([0, *(math.prod(shape) for shape in self._shapes)])

    @property
    def places(self) -> dict[str, int]:
        """Where each number of the tree stands in the vector; of an array, its first."""
        return dict(zip(self.paths, self._ends[:-1].tolist(), strict=True))

    @property
    def key(self) -> Any:
        """What is the same for trees that differ in the values of their numbers alone."""
        return self._structure, tuple(self._shapes)

    def vector(self, tree: PyTree, dtype: npt.DTypeLike | None = None) -> Float[np.ndarray, " numbers"]:
        """The numbers of a tree of the same structure, in the order of `paths`."""
        leaves = [np.ravel(np.asarray(leaf, float)) for leaf in self._structure.flatten_up_to(tree)]
        joined = np.concatenate([np.zeros(0), *leaves])
        return joined.astype(jnp.result_type(float) if dtype is None else dtype)

    def tree(self, vector: Float[Array, " numbers"]) -> Any:
        """The tree with these numbers. It builds no part anew, so it checks nothing and may be traced."""
        parts = zip(self._ends[:-1].tolist(), self._ends[1:].tolist(), self._shapes, strict=True)
        return self._structure.unflatten([vector[start:end].reshape(shape) for start, end, shape in parts])


def path_of(place: tuple[Any, ...]) -> str:
    """A leaf's place in a tree as text, such as `estimator.trace.decay`."""
    return jax.tree_util.keystr(place, simple=True, separator=".")


def numbers_of(tree: PyTree) -> dict[str, Any]:
    """The numbers of a tree of parts, by path."""
    return {path_of(place): leaf for place, leaf in jax.tree_util.tree_leaves_with_path(tree)}


def check_rounded(tree: T, dtype: npt.DTypeLike) -> T:
    """Check a tree of parts again with its numbers rounded to the precision of a run: 1 − 1e-9 becomes 1.

    **Returns** the rounded tree.

    **Raises** `ValueError` that names the path, the number as written and what is allowed.
    """

    def rounded(leaf: object) -> Any:
        if isinstance(leaf, float):
            return float(np.asarray(leaf, dtype))
        return np.asarray(leaf, dtype).astype(float) if isinstance(leaf, np.ndarray) else leaf

    after = jax.tree.map(rounded, tree)
    for path, part in parts_by_path(after):
        try:
            for cls in type(part).__mro__:
                if "__check_init__" in cls.__dict__:
                    cls.__check_init__(part)
        except ValueError as error:
            where = f"{path}." if path else ""
            raise ValueError(f"{where}{error}; it was rounded to {np.dtype(dtype).name}") from None
    return after


def parts_by_path(tree: object, path: str = "") -> Iterator[tuple[str, Part]]:
    """Every part in a tree with its path, the outer ones first."""
    if isinstance(tree, Part):
        yield path, tree
        for name in fields_of(type(tree)):
            yield from parts_by_path(getattr(tree, name), f"{path}.{name}" if path else name)
    elif isinstance(tree, tuple):
        for index, item in enumerate(tree):
            yield from parts_by_path(item, f"{path}.{index}")


def is_live(tree: object, path: str) -> bool:
    """Whether changing the number at a path during a run has an effect. **Raises** `ValueError` for an unknown path."""
    return not metadata_at(tree, path).get("at_start", False)


def metadata_at(tree: object, path: str) -> Mapping[str, Any]:
    """What the field of the number at a path declares: its `range`, and more. **Raises** `ValueError` for an unknown
    path."""
    node = tree
    metadata = {}
    names = path.split(".")
    for place, name in enumerate(names):
        if isinstance(node, Mapping):
            if ".".join(names[place:]) not in node:  # a name of a group may have dots
                raise unknown("number", path, numbers_of(tree))
            break
        if isinstance(node, tuple):
            node = node[int(name)]
            metadata = {}
        else:
            found = fields_of(type(node)) if isinstance(node, Part) else {}
            if name not in found:
                raise unknown("number", path, numbers_of(tree))
            node = getattr(node, name)
            metadata = found[name].metadata
    return metadata


def with_number(tree: T, path: str, value: object) -> T:
    """The tree with another number at a path. The parts on the way are built anew, and so checked.

    **Raises** `ValueError` for a path where there is no number, and for a value out of its range.
    """
    if not _surely_number(tree, path) and path not in numbers_of(tree):
        raise unknown("number", path, numbers_of(tree))

    def replaced(node: object, names: list[str], where: str) -> Any:
        if not names:
            return value
        name, *rest = names
        here = f"{where}.{name}" if where else name
        if isinstance(node, Mapping):  # a name of a group may have dots
            return {**node, ".".join(names): value}
        if isinstance(node, tuple):
            place = int(name)
            return (*node[:place], replaced(node[place], rest, here), *node[place + 1 :])
        inner = replaced(getattr(node, name), rest, here)
        try:
            return _with_field(node, name, inner)
        except ValueError as error:
            raise ValueError(f"{where}.{error}" if where else str(error)) from None

    return replaced(tree, path.split("."), "")


def _surely_number(tree: object, path: str) -> bool:
    """Whether there is a number at a path, found without a walk over the whole tree; `False` where that is not sure."""
    node = tree
    for name in path.split("."):
        field = type(node).__dataclass_fields__.get(name) if isinstance(node, Part) else None
        if field is None or field.metadata.get("static", False):
            return False
        node = object.__getattribute__(node, name)
    return isinstance(node, float | np.ndarray | jax.Array)


def _with_field(part: Any, name: str, value: object) -> Any:
    """The part with another value of a field, checked. Studies make many thousands of these."""
    if not isinstance(part, Part) or not _is_plain(type(part)):
        return dataclasses.replace(part, **{name: value})
    made = object.__new__(type(part))
    for field in dataclasses.fields(part):
        object.__setattr__(made, field.name, object.__getattribute__(part, field.name))
    convert = type(part).__dataclass_fields__[name].metadata.get("converter")
    object.__setattr__(made, name, value if convert is None else convert(value))
    for cls in type(part).__mro__:
        if cls is Part:  # the other fields have been checked
            _check_field(made, name, type(part).__dataclass_fields__[name])
            type(made).validate(made)
        elif "__check_init__" in cls.__dict__:
            cls.__check_init__(made)
    return made


@functools.cache
def _is_plain(cls: type) -> bool:
    """Whether a part is made of the values of its fields and of nothing else."""
    written = vars(cls)["__dataclass_params__"].init
    return written and not hasattr(cls, "__post_init__") and all(f.init for f in dataclasses.fields(cls))


def _number(value: object) -> Any:
    """A number as it is kept: a float, an array of them, or a mapping of either; anything else is left to the check.
    A mapping within one gives its numbers longer names: `{"movement": {"bias": 0.1}}` is `{"movement.bias": 0.1}`."""
    if isinstance(value, Mapping):
        found: dict[str, Any] = {}
        for name, item in value.items():
            kept = _number(item)
            inner = kept if isinstance(kept, dict) else {"": kept}
            found |= {f"{name}.{own}" if own else str(name): each for own, each in inner.items()}
        return found
    if isinstance(value, bool | np.bool_):
        return value
    if isinstance(value, int | float | np.number):
        return float(value)
    if isinstance(value, list | tuple | np.ndarray):
        try:
            array = np.asarray(value)
        except ValueError:
            return value
        return array.astype(float) if array.dtype.kind in "iuf" else value
    return value


def _check_field(part: Part, name: str, field: dataclasses.Field[Any]) -> None:
    value = object.__getattribute__(part, name)
    if is_tracer(value) or isinstance(value, jax.Array):
        return
    hint = hints_of(type(part))[name]
    options = options_of(hint)
    if value is None and type(None) in options:
        return
    if "range" in field.metadata:
        _check_number(name, value, field.metadata["range"], field.metadata["groups"], options)
    elif "whole" in field.metadata:
        low, high = field.metadata["whole"]
        text = any(
            typing.get_origin(option) is typing.Literal and value in typing.get_args(option) for option in options
        )
        whole = isinstance(value, int) and not isinstance(value, bool) and low <= value <= high
        check(text or whole, name, value, _whole_words(low, high, options))
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


def _check_number(name: str, value: object, allowed: Range, groups: bool, options: tuple[Any, ...]) -> None:
    schedules = parts_in(typing.Union[options])  # noqa: UP007
    if schedules and isinstance(value, schedules):
        return
    if groups and isinstance(value, Mapping):
        for group, item in value.items():
            traced = is_tracer(item) or isinstance(item, jax.Array)
            check(traced or allowed.allows(item), f"{name}.{group}", item, f"{allowed}, or an array of such numbers")
        return
    single = isinstance(value, float) or (groups and isinstance(value, np.ndarray))
    words = str(allowed)
    if type(None) in options:
        words = f"None or {words}"
    if schedules:
        words = f"{words}, or {' or '.join(with_article(kind.__name__) for kind in schedules)}"
    if groups:
        words = f"{words}, or a mapping from groups of parameters to such numbers"
    check(single and allowed.allows(value), name, value, words)


def _whole_words(low: int, high: int, options: tuple[Any, ...]) -> str:
    words = f"an integer of at least {low}" if high >= 2**30 else f"an integer from {low} to {high:,}"
    literals = [
        shown(item)
        for option in options
        if typing.get_origin(option) is typing.Literal
        for item in typing.get_args(option)
    ]
    return " or ".join([words, *literals, *(["None"] if type(None) in options else [])])


def with_article(name: str) -> str:
    """A name with its article."""
    return f"{'an' if name[:1] in 'AEIOU' else 'a'} {name}"
