"""How raw observations become what a policy sees, and how its actions become raw ones: data, and pure functions."""

import dataclasses
import functools
import json
import math
from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any, Literal, Self, get_args

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Bool, Float

from motorgrad._arrays import Real
from motorgrad._errors import check, check_integer, choice, counted
from motorgrad._running import RunningMean, add_observation, running_mean, standardised

Form = Literal["same", "clip", "choice", "sum", "each", "antagonists"]
FORMS = get_args(Form)
CODE_KINDS = ("binary", "discrete", "continuous", "querying")
MAX_NUMBERS = 2**24
"""Numbers of a stored interface, in each of its arrays."""
MAX_NAME_CHARACTERS = 1000
"""The length of a stored name."""
WHOLE_NUMBERS_END = 2**31
"""Whole numbers of raw actions that a compiled or exported program can give are below this."""


class _Data:
    """A frozen dataclass with arrays, equal where all numbers are: compiled programs are shared by equal ones."""

    def table(self) -> dict[str, Any]:
        """The data as a table that JSON can hold."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}  # type: ignore[arg-type]
        arrays = {name: self._written(value) for name, value in values.items() if isinstance(value, np.ndarray)}
        return values | arrays | {name: list(value) for name, value in values.items() if isinstance(value, tuple)}

    def _written(self, array: np.ndarray) -> list[Any]:
        return array.tolist()

    @functools.cached_property
    def _key(self) -> str:
        return json.dumps(self.table(), sort_keys=True)

    def __eq__(self, other: object) -> bool:
        return self is other or (type(self) is type(other) and self._key == other._key)  # pyright: ignore[reportAttributeAccessIssue]

    def __hash__(self) -> int:
        return hash(self._key)


@dataclasses.dataclass(frozen=True, eq=False)
class ObservationCode(_Data):
    """How raw observations, of these `names` and this `shape`, become what a policy sees, flattened.

    - `offset`, `divisor`: a raw number y becomes (y − offset) / divisor;
    - `running`: or, where true, the difference from the running mean in standard deviations, clipped to ±5.
    - `constant`: whether a 1 follows, for a policy without a bias.
    """

    names: tuple[str, ...]
    offset: Float[np.ndarray, " size"]
    divisor: Float[np.ndarray, " size"]
    running: np.ndarray
    shape: tuple[int, ...]
    constant: bool = False

    @classmethod
    def plain(cls, names: Sequence[str], running: bool = False) -> Self:
        """The code of numbers that are seen as they are, or all by running statistics."""
        size = len(names)
        zeros = np.zeros(size, np.float32)
        return cls(tuple(names), zeros, zeros + 1, np.full(size, running), (size,))

    @property
    def size(self) -> int:
        """How many raw numbers there are."""
        return len(self.names)

    @property
    def scales(self) -> bool:
        """Whether what is seen differs from the raw numbers."""
        return bool(self.running.any() or self.offset.any() or (self.divisor != 1).any() or self.constant)

    def start(self) -> tuple[RunningMean, RunningMean] | tuple[None, None]:
        """The running mean and variance before any observation; `None` where there are none."""
        nothing = running_mean(jnp.zeros(self.size)) if self.running.any() else None
        return nothing, nothing  # type: ignore[return-value]

    def observe(
        self,
        mean: RunningMean | None,
        variance: RunningMean | None,
        frozen: Bool[Array, ""] | bool,
        raw: Float[Array, " size"],
    ) -> tuple[RunningMean | None, RunningMean | None, Float[Array, " seen"]]:
        """Add a raw observation to the running statistics, unless they are `frozen`. **Returns** them, and what the
        policy sees."""
        if mean is not None and variance is not None:
            mean, variance = jax.tree.map(
                lambda old, new: jnp.where(frozen, old, new), (mean, variance), add_observation(mean, variance, raw)
            )
        return mean, variance, self.encode(mean, variance, raw)

    def encode(
        self, mean: RunningMean | None, variance: RunningMean | None, raw: Float[Array, " size"]
    ) -> Float[Array, " seen"]:
        """What the policy sees of a raw observation, by these running statistics."""
        seen = raw
        if not self.running.all() and (self.offset.any() or (self.divisor != 1).any()):
            seen = (raw - self.offset) / self.divisor
        if mean is not None and variance is not None:
            scaled = standardised(mean, variance, raw)
            seen = scaled if self.running.all() else jnp.where(self.running, scaled, seen)
        return jnp.append(seen, 1.0) if self.constant else seen

    @classmethod
    def of_table(cls, table: Mapping[str, Any], where: str) -> Self:
        """The inverse of `table`. **Raises** `ValueError` that names what is wrong."""
        _check_keys(table, cls, where)
        names = _names(table["names"], f"{where}.names")
        shape = _shape(table["shape"], f"{where}.shape")
        size = len(names)
        offset, divisor = (_numbers(table[name], f"{where}.{name}", (size,)) for name in ("offset", "divisor"))
        check((divisor != 0).all(), f"{where}.divisor", table["divisor"], "numbers other than 0")
        running = table["running"]
        right = isinstance(running, list) and len(running) == size and all(isinstance(each, bool) for each in running)
        check(right, f"{where}.running", running, f"true or false, {size} times")
        check(math.prod(shape) == size, f"{where}.shape", table["shape"], f"of {counted(size, 'number')}")
        check(isinstance(table["constant"], bool), f"{where}.constant", table["constant"], "true or false")
        single = offset.astype(np.float32), divisor.astype(np.float32)
        return cls(names, *single, np.array(running, bool), shape, table["constant"])


@dataclasses.dataclass(frozen=True, eq=False)
class ActionCode(_Data):
    """How a policy's action becomes the raw action of the environment.

    - `kind`: of the policy's action, as in `Policy.actions`; `size`: how many units it has, or alternatives.
    - `form`: `"same"`, the action itself; `"clip"`, within `low` and `high`, where these are whole numbers the
      nearest one; `"choice"`, a row of the `matrix`; `"sum"`, the sum of the rows of the `matrix` that belong to
      active units, and `start`; `"each"`, `high` where the unit is active, else `low`; `"antagonists"`, `high`, `low`
      or `start`, where the sum of those rows is above, below or equal to 0.
    - `names`: of the policy's actions, where they have some.
    - `shape`, `dtype`: of a raw action.
    """

    kind: str | tuple[str, ...]
    size: int
    form: Form = "same"
    names: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()
    dtype: str = "float32"
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    matrix: np.ndarray | None = None
    start: np.ndarray | None = None

    @property
    def bounds(self) -> tuple[tuple[float, float], ...] | None:
        """The range of each graded unit."""
        if self.form != "clip" or self.low is None or self.high is None:
            return None
        return tuple(zip(self.low.tolist(), self.high.tolist(), strict=True))

    @property
    def outputs(self) -> int:
        """How many raw numbers there are."""
        if self.form == "same":
            return 1 if self.kind == "discrete" else self.size
        numbers = self.low if self.matrix is None else self.matrix.T
        assert numbers is not None
        return len(numbers)

    def decode(self, action: Real, xp: ModuleType = np) -> Any:
        """The raw numbers `(…, outputs)` for actions `(…, size)` of zeros and ones or real, or for the number of an
        alternative `(…)`; `xp` is NumPy, or `jax.numpy` in programs that are compiled."""
        if self.form == "same":
            return action
        given: list[Any] = [
            None if array is None else xp.asarray(array) for array in (self.low, self.high, self.matrix, self.start)
        ]
        low, high, matrix, start = given
        if self.form == "choice":
            return matrix[action]
        if self.form == "sum":  # in its own type, as floating-point numbers round the sums of large ones
            return xp.asarray(action, matrix.dtype) @ matrix + start
        if self.form == "each":
            return xp.where(action > 0, high, low)
        if self.form == "antagonists":
            net = action @ matrix
            return xp.where(net > 0, high, xp.where(net < 0, low, start))
        if np.dtype(self.dtype).kind in "biu":
            # of what is not a number there is no whole one: the policy of such a seed is told to be broken elsewhere
            return xp.fmax(xp.fmin(xp.rint(action), high), low)
        return xp.clip(action, low, high)

    def native(self, action: npt.ArrayLike) -> np.ndarray:
        """Raw actions as the environment takes them, `(…, *shape)`, in NumPy."""
        action = np.asarray(action)
        if self.form == "choice":  # once per step of every environment: it is to be quick
            return self._alternatives[action.astype(np.intp)]
        rows = action.shape if self.kind == "discrete" else action.shape[:-1]
        return np.asarray(self.decode(action)).astype(self.dtype).reshape((*rows, *self.shape))

    @functools.cached_property
    def _alternatives(self) -> np.ndarray:
        """The raw actions of all alternatives."""
        assert self.matrix is not None
        return self.matrix.astype(self.dtype).reshape((self.size, *self.shape))

    def of_raw(self, raw: npt.ArrayLike, where: str = "action") -> np.ndarray:
        """The policy's action for a raw one: the inverse of `native`, for one action. **Raises** `ValueError` for
        another size, for an action that is no alternative, and for codes of units, which have no inverse."""
        raw = np.asarray(raw)
        check(raw.size == self.outputs, f"size of an {where}", raw.size, f"{self.outputs}")
        if self.form == "choice" and self.matrix is not None:
            rows = np.flatnonzero((self.matrix == raw.ravel()).all(axis=1))
            check(rows.size, where, raw.tolist(), "one of the alternatives")
            return rows[:1].astype(np.int32)
        usual = self.form in ("same", "clip")
        check(usual, where, f"a raw action, code {self.form!r}", "of a task whose code has an inverse, as 'continuous'")
        return raw.reshape(-1)

    def check_traceable(self) -> None:
        """Refuse whole numbers that compiled programs do not have. **Raises** `ValueError`."""
        for name in ("low", "high", "matrix", "start"):
            array = getattr(self, name)
            if array is not None and array.dtype.kind in "iu" and array.size:
                wide = max(abs(int(array.min())), abs(int(array.max())))
                below = f"below {WHOLE_NUMBERS_END:,} for compiled and exported programs"
                check(wide < WHOLE_NUMBERS_END, f"actions.{name}", wide, below)

    def _written(self, array: np.ndarray) -> list[Any]:
        return [array.dtype.name, array.tolist()]

    @classmethod
    def of_table(cls, table: Mapping[str, Any], where: str) -> Self:
        """The inverse of `table`. **Raises** `ValueError` that names what is wrong."""
        _check_keys(table, cls, where)
        check_integer(f"{where}.size", table["size"], 1, MAX_NUMBERS)
        size = table["size"]
        kind = table["kind"]
        if isinstance(kind, list):
            kind = tuple(kind)
            right = len(kind) == size and all(each in ("binary", "continuous") for each in kind)
            check(right, f"{where}.kind", kind, f"'binary' or 'continuous', {size} times")
        else:
            check(kind in CODE_KINDS, f"{where}.kind", kind, f"one of {', '.join(CODE_KINDS)}")
        choice(f"{where}.form", table["form"], FORMS)
        names = _names(table["names"], f"{where}.names")
        shape = _shape(table["shape"], f"{where}.shape")
        check(len(names) in (0, size), f"{where}.names", len(names), f"{size} names, or none")
        dtype = table["dtype"]
        known = ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32")
        numbers = (*known, "uint64", "float16", "float32", "float64")
        check(dtype in numbers, f"{where}.dtype", dtype, "a type of numbers")
        n = math.prod(shape)
        units = (size, n)
        shapes = {
            "same": {},
            "clip": {"low": (n,), "high": (n,)},
            "choice": {"matrix": units},
            "sum": {"matrix": units, "start": (n,)},
            "each": {"low": (n,), "high": (n,)},
            "antagonists": {"low": (n,), "high": (n,), "matrix": units, "start": (n,)},
        }[table["form"]]
        arrays: dict[str, np.ndarray | None] = {}
        for name in ("low", "high", "matrix", "start"):
            given = table[name]
            here = (given is not None) == (name in shapes)
            wanted = "given" if name in shapes else "null"
            check(here, f"{where}.{name}", given, f"{wanted} for the form {table['form']!r}")
            if given is not None:
                right = isinstance(given, list) and len(given) == 2 and given[0] in (*known, "float32", "float64")
                check(right, f"{where}.{name}", given, "a type and numbers")
                arrays[name] = _numbers(given[1], f"{where}.{name}", shapes[name]).astype(given[0])
        plain = table["form"] == "same" and kind not in ("discrete", "querying")
        one_each = plain or table["form"] in ("clip", "each")
        check(not one_each or n == size, f"{where}.shape", shape, f"of {counted(size, 'number')}")
        discrete = kind == "discrete"
        fits = discrete == (table["form"] == "choice") or table["form"] == "same"
        check(fits, f"{where}.form", table["form"], f"one for {kind} actions")
        return cls(kind, size, table["form"], names, shape, dtype, **arrays)


def _check_keys(table: object, cls: type, where: str) -> None:
    known = [field.name for field in dataclasses.fields(cls)]
    found = sorted(table) if isinstance(table, Mapping) and all(isinstance(key, str) for key in table) else table
    check(found == sorted(known), where, found, f"a table of {', '.join(known)}")


def _names(value: list[str], where: str) -> tuple[str, ...]:
    right = isinstance(value, list) and len(value) <= MAX_NUMBERS
    right = right and all(isinstance(each, str) and len(each) <= MAX_NAME_CHARACTERS for each in value)
    check(right, where, value, f"names of at most {MAX_NAME_CHARACTERS:,} characters")
    return tuple(value)


def _shape(value: list[int], where: str) -> tuple[int, ...]:
    right = isinstance(value, list) and len(value) <= 32
    right = right and all(type(each) is int and 0 < each <= MAX_NUMBERS for each in value)
    check(right, where, value, "lengths of axes")
    return tuple(value)


def _numbers(value: object, where: str, shape: tuple[int, ...]) -> np.ndarray:
    """Stored numbers of a shape, in the widest type that has them."""

    def flat(part: Any, lengths: tuple[int, ...]) -> list[Any]:
        if not lengths:
            check(type(part) in (int, float, bool), where, part, "a number")
            return [part]
        right = isinstance(part, list) and len(part) == lengths[0]
        check(right, where, part, f"numbers of shape {shape}")
        return [number for each in part for number in flat(each, lengths[1:])]

    numbers = flat(value, shape)
    check(len(numbers) <= MAX_NUMBERS, where, len(numbers), f"at most {MAX_NUMBERS:,} numbers")
    check(all(abs(number) <= 2**63 for number in numbers), where, value, "finite numbers")  # false for NaN, too
    return np.array(numbers, None if numbers else float).reshape(shape)
