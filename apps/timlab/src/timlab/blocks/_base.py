"""Shared by many blocks: base classes with one shape, checks of user-given names, and settings in TOML."""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from motorgrad._errors import check, shown
from motorgrad._limits import MAX_BLOCK_SETTINGS_CHARACTERS
from motorgrad._reading import toml_in
from motorgrad.schema import static
from timlab.diagram import Block, Port, Ports, parameters_of


class OneShape(Block):
    """A block with one output `y` whose parameters are scalars or arrays that broadcast to `shape`.

    It declares no field: a subclass chooses the place of `shape` among its own.
    """

    shape: tuple[int, ...]

    def validate(self) -> None:
        for name in parameters_of(type(self)):
            self.check_broadcasts(name, self.shape)

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape)}

    def filled(self, value: Array) -> Array:
        """A value broadcast to the block's shape."""
        return jnp.broadcast_to(value, self.shape)


@dataclasses.dataclass(frozen=True)
class Shaped(OneShape):
    """A block with one output `y` whose `shape` is given by name."""

    _: dataclasses.KW_ONLY
    shape: tuple[int, ...] = static((), help="shape of the signals")


@dataclasses.dataclass(frozen=True)
class Elementwise(Shaped):
    """A block whose output `y` has the shape of its input `u`."""

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}


@dataclasses.dataclass(frozen=True)
class TimeSource(Shaped):
    """A source whose output is a function of time alone."""

    timed: ClassVar[bool] = True


MAX_LISTED_NAMES = 100
_NAME = re.compile(r"[^\W\d]\w{0,39}")


def check_names(setting: str, names: tuple[str, ...], taken: Sequence[str] | set[str] = (), least: int = 0) -> None:
    """Check that a setting is a list of distinct names of letters, digits and `_`, none of which is `taken`."""
    check(least <= len(names) <= MAX_LISTED_NAMES, setting, names, f"a list of {least} … {MAX_LISTED_NAMES} names")
    for place, name in enumerate(names):
        check(_NAME.fullmatch(name), f"{setting}[{place}]", name, "1 to 40 letters, digits or _, a letter or _ first")
        check(name not in taken, f"{setting}[{place}]", name, "another name: this one is already in use")
    repeated = {name for name in names if names.count(name) > 1}
    check(not repeated, setting, names, f"distinct names; repeated are {', '.join(map(shown, sorted(repeated)))}")


def check_limits(block: Any) -> None:
    """Check that a block's parameter `low` is below `high`, in every element."""
    check(np.all(np.less(block.low, block.high)), "low", block.low, f"below high = {block.high}")


def as_text(name: str, value: Mapping[str, Any] | str) -> str:
    """A table as TOML; a string is returned unchanged. **Raises** `ValueError` for invalid TOML."""
    if isinstance(value, Mapping):
        import tomli_w

        try:
            value = tomli_w.dumps(dict(value)).strip()
        except TypeError as error:
            raise ValueError(f"{name}: must contain numbers, strings, lists and tables only: {error}") from None
    read_table(name, value)
    return value


def read_table(name: str, text: Any) -> dict[str, Any]:
    """Parse a TOML text. **Raises** `ValueError` for invalid TOML."""
    check(
        len(text) <= MAX_BLOCK_SETTINGS_CHARACTERS,
        name,
        text,
        f"a string of at most {MAX_BLOCK_SETTINGS_CHARACTERS:,} characters",
    )
    try:
        return toml_in(text)
    except ValueError as error:
        raise ValueError(f"{name} = {shown(text)}: must be TOML, such as 'units = 8': {error}") from None
