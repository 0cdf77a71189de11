"""Blocks derived from the parts of a learner.

A part's numbers become parameters of the block and its other fields settings, as the part's class declares them. The
fields of a part within a part stand beside them. Where several kinds of part may stand in a place, a setting chooses
the kind, and the fields of every kind are there; those of the other kinds have no effect.
"""

import dataclasses
import functools
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, Literal

import equinox as eqx
import jax
import numpy as np

from motorgrad.schema import (
    PART_CLASSES,
    Declared,
    Part,
    Range,
    declared_by,
    default_of,
    fields_of,
    hints_of,
    holds_numbers,
    kind_of,
    options_of,
    parts_in,
    path_of,
    summary_of,
)
from timlab.diagram import Block


@dataclasses.dataclass(frozen=True, kw_only=True)
class PartBlock(Block):
    """A block that does what one part of a learner does. `block_of` derives the classes of actual parts."""

    category: ClassVar[str] = "learning"
    part: ClassVar[type[Part]]
    """The class of the part."""
    places: ClassVar[Mapping[str, str]] = {}
    """The names of the fields that stand for those of the part, by their paths in its tree."""

    def validate(self) -> None:
        super().validate()
        for name, declared in self.parameters.items():
            if name in self.places.values():
                self.check_broadcasts(name, self.number_shape(declared))
        _ = self.template

    def number_shape(self, declared: Declared) -> tuple[int, ...]:
        """The shape to which the values of a parameter must broadcast."""
        return ()

    def number(self, name: str) -> Any:
        """A parameter's array, as the part takes it."""
        return getattr(self, name)

    @functools.cached_property
    def template(self) -> Any:
        """The part with one plain number for each parameter. Building it checks the values together."""
        numbers = self.parameters

        def built(part: type[Part], path: str) -> Part:
            given = {}
            for name in fields_of(part):
                place = f"{path}{name}"
                kinds = _kinds_in(part, name)
                own = self.places.get(place)
                value = next(iter(kinds)) if own is None else getattr(self, own)
                if kinds:
                    given[name] = None if value == "none" else built(kinds[value], f"{place}.")
                else:
                    given[name] = float(np.ravel(value)[0]) if own in numbers else value
            return part(**given)

        return built(self.part, "")

    @property
    def bound_part(self) -> Any:
        """The part with this block's arrays as its numbers: what the functions of a running block use."""
        return jax.tree_util.tree_map_with_path(
            lambda place, _: self.number(self.places[path_of(place)]), self.template
        )


@functools.cache
def block_of(base: type[PartBlock], part: type[Part], name: str) -> Any:
    """The class of a block for a part: `base` with the part's fields.

    **Arguments:** the `base` class; the `part`; the `name` of the type in files.
    """
    fields: dict[str, tuple[str, Any, Any]] = {}
    for path, hint, field in _tree_fields(part):
        place, _, own = path.rpartition(".")
        if path not in fields:  # else it is that of another kind of part in the same place
            taken = own in [other for other, *_ in fields.values()] or hasattr(base, own)
            fields[path] = (f"{place.replace('.', '_') or part.__name__.lower()}_{own}" if taken else own, hint, field)
    space = {
        "name": name,
        "part": part,
        "places": {path: own for path, (own, *_) in fields.items()},
        "__doc__": "\n\n".join(filter(None, [summary_of(part), summary_of(base)])),
        "__module__": base.__module__,
    }
    title = _title(name, part)
    return dataclasses.make_dataclass(title, list(fields.values()), bases=(base,), namespace=space, frozen=True)


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
        return block_of(self._bases[kind][1](part), part, name)

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


def _title(name: str, part: type[Part]) -> str:
    """The class of a block: that of the part where the block is called like the part, else the name in CapWords."""
    if name not in ESTABLISHED.values() and any(kinds.get(name) is part for kinds in PART_CLASSES.values()):
        return part.__name__
    return "".join(word[:1].upper() + word[1:] for word in re.split(r"\W+", name))


def _tree_fields(
    part: type[Part], path: str = "", about: str = "", default: Part | None = None
) -> Iterator[tuple[str, Any, Any]]:
    """The fields of a part's tree as those of a block: the path, the type and the field."""
    for name, field in fields_of(part).items():
        hint = hints_of(part)[name]
        place = f"{path}{name}"
        usual = default_of(field) if default is None else getattr(default, name)
        declared = declared_by(field)
        declared = dataclasses.replace(declared, help=f"{about}{declared.help}") if about else declared
        optional = type(None) in options_of(hint)
        kinds = _kinds_in(part, name)
        if kinds:
            names = [*kinds, *(["none"] if optional else [])]
            chosen = "none" if usual is None else kind_of(usual) if isinstance(usual, Part) else names[0]
            if len(names) > 1:
                yield place, Literal[tuple(names)], _field(declared, chosen)  # type: ignore[valid-type]
            for kind in sorted(kinds, key=lambda kind: kind != chosen):  # the default's own values come first
                inner = usual if isinstance(usual, kinds[kind]) else None
                within = f"with {name} = {kind!r}: " if len(kinds) > 1 else ""
                yield from _tree_fields(kinds[kind], f"{place}.", within, inner)
        elif holds_numbers(field):
            usual = _least(declared) if usual is dataclasses.MISSING else usual
            yield place, Any | None if optional else Any, _field(declared, usual, static=False)
        else:
            yield place, hint, _field(declared, usual)


def usual_part(part: type[Part]) -> Any:
    """The part with its defaults, and with the least numbers where there are none."""
    missing = [name for name, field in fields_of(part).items() if default_of(field) is dataclasses.MISSING]
    return part(**{name: _least(declared_by(fields_of(part)[name])) for name in missing})


def _least(declared: Declared) -> float:
    """The number nearest to 0 that may be given."""
    ends = declared.range or Range()
    return min(max(0.0, ends.low), ends.high)


def _field(declared: Declared, default: object, static: bool = True) -> Any:
    return eqx.field(default=default, static=static, metadata={"declared": declared})


def _kinds_in(part: type[Part], name: str) -> dict[str, type[Part]]:
    """The parts that may stand in a field of a part, by name; none where it holds numbers, which are constant here."""
    found = () if holds_numbers(fields_of(part)[name]) else parts_in(hints_of(part)[name])
    return {name: cls for kind in found for name, cls in (kind.kinds() or {kind.__name__: kind}).items()}
