"""The terms of composed tasks, and what they see."""

import abc
import functools
import inspect
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from motorgrad import schema
from motorgrad._errors import check, unknown
from motorgrad.bodies import Anatomy, Body, BodyState, actuator_units, joint_columns, muscular
from motorgrad.schema import Part, kind_of, number, static
from motorgrad.tasks._task import Scalar

Names = str | tuple[str, ...]
"""A name, a pattern such as `flexor*`, or several of them."""
Numbers = tuple[float, ...]
Units = str | tuple[str, ...]
"""The unit of some numbers, or that of each: `1` of a pure number, empty where it is unknown."""
PURE = "1"
ROUNDING = 1e-7  # of a cycle: what misses the end of one by less is at its end


def by_name(default: Names = "*", help: str = "") -> Any:
    """Declare a field that holds names, or patterns of names."""
    return static(default, converter=lambda v: tuple(v) if isinstance(v, list) else v, help=help)


def vector(default: Numbers | None = None, unit: str = "", help: str = "") -> Any:
    """Declare a field that holds a row of numbers, or none."""
    return static(default, converter=lambda v: v if v is None else tuple(map(float, v)), unit=unit, help=help)


class Now(NamedTuple):
    """What a term sees at a decision.

    - `state`: of the body.
    - `control` (groups): of each group of actuators in the decision that led here; zeros at the start of an episode.
    - `time` (s): since the start of the episode.
    - `drawn`: by name, what each target drew for this episode.
    - `memory`: what the term itself remembers.
    - `decisions`: made in this episode, one every `period` (s): `time` is their product, in single precision.
    """

    state: BodyState
    control: Float[Array, " groups"]
    time: Scalar
    drawn: Mapping[str, Any]
    memory: Any = ()
    decisions: Int[Array, ""] | int = 0
    period: float = 0.0

    def cycles(self, length: float) -> Scalar:
        """The time in units of `length` seconds without the whole ones, from 0 to 1: exact to single precision after
        years of an episode, where `time / length` is not."""
        with jax.enable_x64(True):
            passed = jnp.asarray(self.decisions).astype(jnp.float64) * (self.period / length)
            return jnp.maximum((passed + ROUNDING) % 1.0 - ROUNDING, 0.0).astype(jnp.float32)


class Bound(NamedTuple):
    """A term of a certain body: pure functions of one seed.

    - `read`: the quantity, or the observed numbers.
    - `names`: names of the observed numbers.
    - `init`: what the term remembers at the start of an episode, where it remembers anything.
    - `step`: what it remembers after a decision, from what it remembered before.
    - `units`: the unit of the quantity or of all observed numbers, or that of each: `1` of a pure number, empty where
      it is unknown.
    """

    read: Callable[[Now], Any]
    names: tuple[str, ...] = ()
    init: Any = None
    step: Callable[[Now], Any] | None = None
    units: Units = ""


class BoundTarget(NamedTuple):
    """A target of a certain body: pure functions of one seed.

    - `names`: names of its numbers.
    - `uniforms`: numbers from U[0, 1) that `draw` consumes.
    - `draw(uniforms)`: what is drawn for an episode, any pytree.
    - `wanted(drawn, time)`: where the target is, at a time (s) in the episode.
    - `actual(state)`: where the body is.
    - `marked`: whether its numbers are places (m), three for each, which pictures of the body mark.
    - `moves`: whether it moves within an episode.
    - `shown`: the names under which `Positions` or `JointPositions` show where the body is, in the order of `names`.
    - `length` (s): after which its motion repeats; 0 if it does not.
    - `units`: of its numbers, as in `Bound`.
    """

    names: tuple[str, ...]
    uniforms: int
    draw: Callable[[Any], Any]
    wanted: Callable[[Any, Scalar], Array]
    actual: Callable[[BodyState], Array]
    marked: bool = False
    moves: bool = False
    shown: tuple[str, ...] = ()
    length: float = 0.0
    units: Units = ""

    def at(self, now: Now, name: str) -> Array:
        """Where the target of this name is now."""
        return self.wanted(now.drawn[name], self.length * now.cycles(self.length) if self.length else now.time)

    def error(self, now: Now, name: str) -> Array:
        """The vector from the body to the target."""
        return self.at(now, name) - self.actual(now.state)


class Scene(Anatomy):
    """The parts of a body by name, with the targets of a task.

    **Arguments:** the `body`; the `period` (s) between two decisions; the `targets`.
    """

    def __init__(self, body: Body, period: float, targets: Sequence["Target"] = ()):
        super().__init__(body)
        self.period = period
        names = [target.name for target in targets]
        for name in names:
            check(names.count(name) == 1, "name of a target", name, "given once")
        self.targets = {target.name: bound("targets", target, self) for target in targets}

    def target(self, name: str) -> BoundTarget:
        """The target of this name."""
        if name not in self.targets:
            raise unknown("target", name, self.targets)
        return self.targets[name]

    def parts(self, names: Names) -> tuple[str, ...]:
        """The names of sites, bodies or geoms, at least one."""
        check(names, "parts", names, "the name of a site, body or geom, or several")
        return (names,) if isinstance(names, str) else names

    def point(self, name: str) -> Callable[[BodyState], Float[Array, " 3"]]:
        """The position (m) of a site, body or geom, as a function of the state."""
        sensor = self.sensor("FRAMEPOS", *self.place(name))
        return lambda state: state.sensors[sensor]

    def motion(self, name: str) -> Callable[[BodyState], Float[Array, " 3"]]:
        """The velocity (m/s) of a site, body or geom, as a function of the state."""
        sensor = self.sensor("FRAMELINVEL", *self.place(name))
        return lambda state: state.sensors[sensor]

    @functools.cached_property
    def _joint_units(self) -> list[str]:
        return [column.unit for column in joint_columns(self.model)]

    def position_units(self, places: Int[np.ndarray, " numbers"]) -> tuple[str, ...]:
        """The units of generalised positions."""
        return tuple(self._joint_units[place] for place in places)

    def velocity_units(self, places: Int[np.ndarray, " numbers"]) -> tuple[str, ...]:
        """The units of generalised velocities."""
        return tuple(self._joint_units[self.model.nq + place] for place in places)

    def actuator_units(self, name: str) -> tuple[str, str, str]:
        """The units of an actuator's length, velocity and force."""
        return actuator_units(self.model, self.model.actuator(name).id)

    def level_unit(self, actuators: Names) -> str:
        """The unit of activations and controls of actuators: of muscles they are pure numbers."""
        muscles = muscular(self.model, self.body)
        return PURE if all(muscles[self.model.actuator(name).id] for name in self.named("actuator", actuators)) else ""


class Observation(Part):
    """A term that observes numbers."""

    _: KW_ONLY
    scale: float = number(1.0, help="the factor of the observed numbers")

    @abc.abstractmethod
    def bind(self, scene: Scene) -> Bound:
        """The term for a body: a function that reads the numbers, and their names."""


class Target(Part):
    """A target: where something should be, drawn anew for each episode and seed, or moving."""

    _: KW_ONLY
    name: str = static("target", help="the name by which other terms refer to it")

    @abc.abstractmethod
    def bind(self, scene: Scene) -> BoundTarget:
        """The target for a body."""


class Quantity(Part):
    """A number that describes the state after a decision. In the reward it is multiplied by its weight. As a
    termination it ends the episode beyond a limit. As a metric it is recorded. It can be observed, too."""

    _: KW_ONLY
    weight: float = number(1.0, help="the factor in the reward")
    above: float | None = number(None, help="as a termination, the limit above which the episode ends")
    below: float | None = number(None, help="as a termination, the limit below which the episode ends")
    name: str | None = static(None, help="name of the metric, by default that of the kind")
    at_end: bool = static(False, help="whether it is recorded only at the end of an episode")

    @abc.abstractmethod
    def bind(self, scene: Scene) -> Bound:
        """The term for a body: a function that reads the number."""


class Reset(Part):
    """A term that chooses the state in which an episode starts. Each term changes what the one before it has chosen."""

    @abc.abstractmethod
    def bind(self, scene: Scene) -> "BoundReset":
        """The term for a body."""


class Start(NamedTuple):
    """The state in which some rows start, in NumPy: positions, velocities and activations."""

    position: Float[np.ndarray, "rows nq"]
    velocity: Float[np.ndarray, "rows nv"]
    activation: Float[np.ndarray, "rows na"]


class BoundReset(NamedTuple):
    """A reset of a certain body.

    - `uniforms`: numbers from U[0, 1) that `apply` consumes, for each row.
    - `apply(start, uniforms)`: the state to start in, from that of the terms before.
    """

    uniforms: int
    apply: Callable[[Start, np.ndarray], Start]


def register(base: type[Part], name: str, term: Any = None) -> Any:
    """Give a term of your own a name, by which Python, options, TOML files and saved runs know it.

    The term is a class that derives from `base`, or a function that takes the place of its `bind`: its first argument
    is the `Scene`, the others are the settings of the term, with their types and defaults. It returns a function of
    `Now`, or a `Bound`, `BoundTarget` or `BoundReset`.

    **Arguments:**

    - `base`: `Observation`, `Target`, `Quantity` or `Reset`.
    - `name`: name of the term.
    - `term`: the class or function. Left out, what follows is decorated.

    **Returns** the class of the term.

    **Raises:** `ValueError` for another base, and for a name that is taken.

    ```python
    @terms.register(terms.Quantity, "apart")
    def apart(scene, first: str, second: str):
        one, two = scene.point(first), scene.point(second)
        return lambda now: jnp.linalg.norm(one(now.state) - two(now.state))
    ```
    """
    if term is None:
        return lambda term: register(base, name, term)
    known = (Observation, Target, Quantity, Reset)
    check(base in known, "base", base, f"one of {', '.join(each.__name__ for each in known)}")
    made = _made_of(base, term) if inspect.isfunction(term) else term
    schema.register(base, name, made)
    return made


def _made_of(base: type[Part], function: Callable[..., Any]) -> type[Part]:
    """The class of a term that a function binds."""
    _, *settings = inspect.signature(function).parameters.values()
    hints = typing.get_type_hints(function)
    fields = {}
    for each in settings:
        given = () if each.default is each.empty else (each.default,)
        fields[each.name] = number(*given) if hints.get(each.name) is float else static(*given)

    def bind(self: Part, scene: Scene) -> Any:
        found = function(scene, **{each: getattr(self, each) for each in fields})
        return Bound(found) if inspect.isfunction(found) else found

    about = {"__module__": function.__module__, "__qualname__": function.__qualname__, "__doc__": function.__doc__}
    types = {each: hints.get(each, Any) for each in fields}
    kind: Any = type(base)
    return kind(function.__name__, (base,), {**about, "__annotations__": types, **fields, "bind": bind})


def bound(what: str, term: Observation | Quantity | Target | Reset, scene: Scene) -> Any:
    """A term bound to a body; an error says which term it is."""
    try:
        return term.bind(scene)
    except ValueError as error:
        raise ValueError(f"{what}: {kind_of(term)}: {error}") from None


def units_of(term: Bound | BoundTarget) -> tuple[str, ...]:
    """The unit of each of a term's numbers."""
    return (term.units,) * len(term.names) if isinstance(term.units, str) else term.units


def common(units: Sequence[str]) -> str:
    """The unit that all have; none where they differ."""
    return units[0] if len(set(units)) == 1 else ""


def scaled(unit: str, factor: float) -> str:
    """The unit of numbers times a factor: none, unless they stay what they are but for their sign, or are pure."""
    return unit if abs(factor) == 1 or unit == PURE else ""


def norm(vector: Array) -> Scalar:
    """The length of a vector."""
    return jnp.sqrt(jnp.sum(vector * vector))
