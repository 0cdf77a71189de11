"""The numbers of a tree of parts: by path, as one vector, and the tree with others."""

import dataclasses
import functools
import math
import typing
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import unknown
from motorgrad.schema._declare import Declared, declared_by
from motorgrad.schema._part import Part, check_part_field, fields_of

T = TypeVar("T")


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


def declared_at(tree: object, path: str) -> Declared:
    """What the field of the number at a path declares. **Raises** `ValueError` for an unknown path."""
    node = tree
    declared = Declared()
    names = path.split(".")
    for place, name in enumerate(names):
        if isinstance(node, Mapping):
            if ".".join(names[place:]) not in node:  # a name of a group may have dots
                raise unknown("number", path, numbers_of(tree))
            break
        if isinstance(node, tuple):
            node = node[int(name)]
            declared = Declared()
        else:
            found = fields_of(type(node)) if isinstance(node, Part) else {}
            if name not in found:
                raise unknown("number", path, numbers_of(tree))
            node = getattr(node, name)
            declared = declared_by(found[name])
    return declared


def with_number(tree: T, path: str, value: object) -> T:
    """The tree with another number at a path. The parts on the way are built anew, and so checked.

    **Raises** `ValueError` for a path where there is no number, and for a value out of its range.
    """
    if not _surely_number(tree, path) and path not in numbers_of(tree):
        raise unknown("number", path, numbers_of(tree))

    *names, last = path.split(".")
    nodes: list[Any] = [tree]
    while names and not isinstance(nodes[-1], Mapping):
        name = names.pop(0)
        nodes.append(nodes[-1][int(name)] if isinstance(nodes[-1], tuple) else getattr(nodes[-1], name))
    outer = path.split(".")[: len(nodes) - 1]
    name = ".".join([*names, last])  # a name of a group may have dots
    for node in reversed(nodes):
        if isinstance(node, Mapping):
            value = {**node, name: value}
        elif isinstance(node, tuple):
            value = (*node[: int(name)], value, *node[int(name) + 1 :])
        else:
            try:
                value = _with_field(node, name, value)
            except ValueError as error:
                raise ValueError(".".join([*outer, str(error)])) from None
        name = outer.pop() if outer else ""
    return typing.cast(T, value)


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
            check_part_field(made, name, type(part).__dataclass_fields__[name])
            type(made).validate(made)
        elif "__check_init__" in cls.__dict__:
            cls.__check_init__(made)
    return made


@functools.cache
def _is_plain(cls: type) -> bool:
    """Whether a part is made of the values of its fields and of nothing else."""
    written = vars(cls)["__dataclass_params__"].init
    return written and not hasattr(cls, "__post_init__") and all(f.init for f in dataclasses.fields(cls))
