"""Blocks derived from the parts of a learner.

A part's numbers become parameters of the block and its other fields settings, with the ranges, defaults and texts of
the part's class. The fields of a part within a part stand beside them. Where several kinds of part may stand in a
place, a setting chooses the kind, and the fields of every kind are there; those of the other kinds have no effect.
"""

import dataclasses
import functools
import math
import re
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.schema import (
    PART_CLASSES,
    Declared,
    Part,
    Range,
    as_hinted,
    declared_by,
    default_of,
    fields_of,
    hints_of,
    kind_of,
    options_of,
    parts_by_path,
    parts_in,
    path_of,
    summary_of,
)
from timlab.diagram import Block, Moment, Parameter, Port, Setting, Signals

T = TypeVar("T")

VALID = Port((), "bool", default=1.0, help="whether the reward of this tick counts")
MAX_UNITS = 10_000
MAX_PARAMETERS = 1_000_000


class Vector(eqx.Module):
    """All parameters of a policy as one array, in place of the policy, for an optimizer or a baseline that is weighted
    by eligibility. They count as one unit."""

    parameters: Float[Array, " size"]

    def blocks(self, gradient: "Vector") -> tuple[Float[Array, "1 size"]]:
        return (gradient.parameters[None],)

    def from_blocks(self, blocks: tuple[Float[Array, "1 size"]]) -> "Vector":
        return Vector(blocks[0][0])


@dataclasses.dataclass(frozen=True)
class BlockField:
    """A field of a block that represents the field at a `path` of a part's tree."""

    name: str
    path: str
    declared: Parameter | Setting
    hint: Any
    default: Any
    range: Range = Range()  # noqa: RUF009
    groups: bool = False

    @property
    def is_number(self) -> bool:
        """Whether it is a parameter of the block."""
        return isinstance(self.declared, Parameter)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PartBlock(Block):
    """A block that does what one part of a learner does. `block_of` derives the classes of actual parts."""

    category: ClassVar[str] = "learning"
    part: ClassVar[type[Part]]
    """The class of the part."""
    part_fields: ClassVar[tuple[BlockField, ...]] = ()
    """The fields that stand for those of the part."""

    def validate(self) -> None:
        super().validate()
        for field in self.part_fields:
            value = getattr(self, field.name)
            if field.is_number and value is not None:
                self.check_broadcasts(field.name, self.number_shape(field))
                check(field.range.allows(value), field.name, value, str(field.range))
            elif isinstance(field.declared, Setting) and not field.declared.choices:
                object.__setattr__(self, field.name, as_hinted(field.hint, value, field.name))
        _ = self.template

    def number_shape(self, field: BlockField) -> tuple[int, ...]:
        """The shape to which the values of a parameter must broadcast."""
        return ()

    def number(self, field: BlockField) -> Any:
        """A parameter's array, as the part takes it."""
        return getattr(self, field.name)

    @functools.cached_property
    def template(self) -> Any:
        """The part with one plain number for each parameter. Building it checks the values together."""
        values = {field.path: getattr(self, field.name) for field in self.part_fields}
        for field in self.part_fields:
            if field.is_number and values[field.path] is not None:
                values[field.path] = float(np.ravel(values[field.path])[0])
        return _built(self.part, "", values)

    @property
    def bound_part(self) -> Any:
        """The part with this block's arrays as its numbers: what the functions of a running block use."""
        fields = {field.path: field for field in self.part_fields}
        return jax.tree_util.tree_map_with_path(lambda place, _: self.number(fields[path_of(place)]), self.template)


def block_of(base: type[PartBlock], part: type[Part], name: str, title: str) -> Any:
    """The class of a block for a part: `base` with the part's fields.

    **Arguments:** the `base` class; the `part`; the `name` of the type in files; the `title` of the class in Python.
    """
    fields = tuple(_fields(part, lambda name: hasattr(base, name)))
    about = "\n\n".join(text for text in (summary_of(part), summary_of(base)) if text)
    space = {"name": name, "part": part, "part_fields": fields, "__doc__": about, "__module__": base.__module__}
    declared = [(field.name, Annotated[field.hint, field.declared], field.default) for field in fields]
    return dataclasses.make_dataclass(title, declared, bases=(base,), namespace=space, frozen=True)


class PartBlocks(Mapping[str, type[Block]]):
    """The types of blocks of all registered parts, by name; a part that is registered later appears by itself.

    Baselines that ask a policy for probabilities have none: a whole learner may have them.

    **Arguments:** for each kind of part the pattern of its blocks' names and a function from a part's class to the base
    class of its block.
    """

    def __init__(self, bases: Mapping[type[Part], tuple[str, Callable[[Any], type[PartBlock]]]]):
        self._bases = bases

    def __getitem__(self, name: str) -> type[Block]:
        kind, part = self._known()[name]
        return _registered(self._bases[kind][1](part), part, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._known())

    def __len__(self) -> int:
        return len(self._known())

    def by_title(self, title: str) -> type[Block]:
        """The type whose class has this name. **Raises** `AttributeError` where there is none."""
        for name, (_, part) in self._known().items():
            if _title(name, part) == title:
                return self[name]
        raise AttributeError(f"no type of block has the class name {title!r}")

    def _known(self) -> dict[str, tuple[type[Part], type[Part]]]:
        found = {}
        for kind, (pattern, _) in self._bases.items():
            for name, part in PART_CLASSES[kind].items():
                if getattr(part, "needs_policy", False):
                    continue
                derived = pattern.format(name)
                found[ESTABLISHED.get(derived, derived)] = (kind, part)
        return found


ESTABLISHED = {
    "critic baseline": "critic",
    "exponential trace": "eligibility trace",
    "lagged-gaussian trace": "lagged trace",
    "root-mean-square normalization": "advantage normalization",
}
"""Names under which blocks are known, in place of those derived from the registry. A new part needs no entry."""


@functools.cache
def _registered(base: type[PartBlock], part: type[Part], name: str) -> Any:
    return block_of(base, part, name, _title(name, part))


def _title(name: str, part: type[Part]) -> str:
    """The class of a block: that of the part where the block is called like the part, else the name in CapWords."""
    if (
        any(name in kinds and kinds[name] is part for kinds in PART_CLASSES.values())
        and name not in ESTABLISHED.values()
    ):
        return part.__name__
    return "".join(word[:1].upper() + word[1:] for word in re.split(r"\W+", name))


def number_parameters(tree: Part) -> dict[str, Parameter]:
    """The declarations of all numbers in a tree of parts, by path."""
    found = {}
    for path, part in parts_by_path(tree):
        for name, field in fields_of(type(part)).items():
            value = getattr(part, name)
            place = f"{path}.{name}" if path else name
            if isinstance(value, Mapping):
                found |= {f"{place}.{group}": _parameter(declared_by(field), False) for group in value}
            elif not isinstance(value, Part):
                found[place] = _parameter(declared_by(field), False)
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {path_of(place): found.get(path_of(place), Parameter()) for place, _ in leaves}


def _fields(part: type[Part], is_taken: Callable[[str], bool]) -> Iterator[BlockField]:
    """The fields of a part's tree, each path once, under names that are not taken."""
    paths: set[str] = set()
    names: set[str] = set()
    for field in _tree_fields(part, "", default_kind="", default=None):
        if field.path in paths:  # of another kind of part in the same place
            continue
        place, _, name = field.path.rpartition(".")
        if name in names or is_taken(name):
            name = f"{place.replace('.', '_') or part.__name__.lower()}_{name}"
        paths.add(field.path)
        names.add(name)
        yield dataclasses.replace(field, name=name)


def _tree_fields(part: type[Part], path: str, default_kind: str, default: Part | None) -> Iterator[BlockField]:
    for name, field in fields_of(part).items():
        hint = hints_of(part)[name]
        place = f"{path}.{name}" if path else name
        usual = default_of(field) if default is None else getattr(default, name)
        about = f"with {path.rpartition('.')[2]} = {default_kind!r}: " if default_kind else ""
        declared = declared_by(field)
        if declared.range is not None and not declared.range.whole:
            allowed = declared.range
            optional = type(None) in options_of(hint)
            if usual is dataclasses.MISSING:
                usual = min(max(0.0, allowed.low), allowed.high)
            shown = _parameter(declared, optional, about)
            hint = float | None if optional else Any
            yield BlockField(name, place, shown, hint, usual, allowed, declared.groups)
        elif kinds := _kinds_in(hint):
            names = [*kinds, *(["none"] if type(None) in options_of(hint) else [])]
            chosen = "none" if usual is None else kind_of(usual) if isinstance(usual, Part) else names[0]
            if len(names) > 1:
                yield BlockField(name, place, Setting(about + declared.help, tuple(names)), str, chosen)
            for kind in sorted(kinds, key=lambda kind: kind != chosen):  # the default's own values come first
                inner = usual if isinstance(usual, kinds[kind]) else None
                yield from _tree_fields(kinds[kind], place, kind if len(kinds) > 1 else "", inner)
        else:
            choices = typing.get_args(hint) if typing.get_origin(hint) is typing.Literal else ()
            unit = f" ({declared.unit})" if declared.unit else ""
            yield BlockField(name, place, Setting(f"{about}{declared.help}{unit}", choices), hint, usual)


def _built(part: type[Part], path: str, values: Mapping[str, Any]) -> Part:
    """A part from the values of its tree's fields by path."""
    given = {}
    for name, field in fields_of(part).items():
        place = f"{path}.{name}" if path else name
        kinds = {} if declared_by(field).live else _kinds_in(hints_of(part)[name])
        if not kinds:
            given[name] = values[place]
            continue
        kind = values.get(place, next(iter(kinds)))
        given[name] = None if kind == "none" else _built(kinds[kind], place, values)
    return part(**given)


def _kinds_in(hint: object) -> dict[str, type[Part]]:
    """The parts that may stand in a field of this type, by name."""
    return {name: cls for kind in parts_in(hint) for name, cls in (kind.kinds() or {kind.__name__: kind}).items()}


def _parameter(declared: Declared, optional: bool, about: str = "") -> Parameter:
    allowed = declared.range or Range()
    is_open = allowed.open_low and (allowed.open_high or allowed.high == math.inf)
    low = float(allowed.low)
    high = float(allowed.high)
    return Parameter(about + declared.help, declared.unit, low, high, open=is_open, optional=optional)


def check_count(name: str, value: int, most: int = MAX_UNITS) -> None:
    """Check a number of units, inputs or parameters."""
    whole = isinstance(value, int) and not isinstance(value, bool)
    check(whole and 1 <= value <= most, name, value, f"an integer from 1 to {most}")


def is_paid(inputs: Signals, now: Moment, port: str = "valid") -> Array:
    """Whether the reward of this tick counts: it is valid, and an action came before it."""
    return inputs[port] & (now.tick > 0)


def where(condition: Array, yes: T, no: T) -> T:
    """The leaves of one tree or of the other."""
    return jax.tree.map(lambda a, b: a if a is b else jnp.where(condition, a, b), yes, no)
