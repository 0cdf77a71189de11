"""Tasks composed of terms."""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._arrays import AnyArray
from motorgrad._errors import check
from motorgrad._goal import Goal
from motorgrad._interface import ObservationCode
from motorgrad._running import RunningMean, counted_on
from motorgrad.bodies import Body, BodyState, OnTerrain, Terrain, start_pose
from motorgrad.schema import inner, kind_of, static
from motorgrad.tasks._composed_goal import goal_of
from motorgrad.tasks._composing import BodyLike, Drive, body_of, body_table, drive_of, reach, with_absolute_paths
from motorgrad.tasks._holding import tell_if_few_can_be_held
from motorgrad.tasks._host_task import BodyTask
from motorgrad.tasks._task import Flag, Metric, Scalar
from motorgrad.tasks.terms import Bound, BoundReset, Observation, Quantity, Reset, Scene, Start, Target
from motorgrad.tasks.terms._term import Now, bound, common, scaled, units_of

MARK = 0.02  # m, the radius of the mark of a target without a tolerance


class ComposedMemory(NamedTuple):
    """The memory of a composed task.

    - `decisions`: made in this episode; at 2,147,483,647 they and the time of targets stand still. `ended`: whether it
      has just ended, by itself or by its limit.
    - `control`: of each group of actuators in the last decision.
    - `drawn`: by name, what each target drew for the episode.
    - `terms`: what terms remember, in their order.
    - `mean`, `variance`: of the observations so far, `None` without scaling; `frozen`: whether they stay as they are.
    """

    decisions: Int[Array, ""]
    ended: Flag
    control: Float[Array, " groups"]
    drawn: dict[str, Any]
    terms: tuple[Any, ...]
    mean: RunningMean | None
    variance: RunningMean | None
    frozen: Flag


class _Bindings(NamedTuple):
    """The terms of a task, bound to its body."""

    scene: Scene
    body: Body
    observe: tuple[tuple[float, Bound], ...]
    reward: tuple[tuple[float, Bound], ...]
    terminate: tuple[tuple[Quantity, Bound], ...]
    metrics: tuple[tuple[str, bool, Bound], ...]
    reset: tuple[BoundReset, ...]
    remembering: tuple[Bound, ...]
    """Those that remember something, whose memories are in this order."""


@dataclasses.dataclass(frozen=True)
class Composed(BodyTask):
    """A task on any body, composed of terms that say what is observed, aimed at, rewarded and recorded, and how
    episodes start and end.

    Each term is an instance of a class in `motorgrad.tasks.terms`, its name, or a table with its `kind` and settings.
    Without a body, a two-joint arm with six muscles reaches for targets.

    **Raises:** `ValueError` for a name that does not exist, with the nearest one, for a model that MuJoCo refuses, and
    for settings that do not go together.

    ```python
    from motorgrad.tasks import compose, terms

    task = compose(
        "arm6",
        targets=[terms.Reach("hand")],
        observe=["joint-positions", "joint-velocities", "target-error"],
        reward=[terms.Distance(), terms.Effort(weight=-0.1)],
        reset=["random-joints"],
        metrics=["distance", terms.Within(tolerance=0.03, name="solved")],
    )
    print(task.observation_names[-3:])  # → ('target error x', 'target error y', 'target error z')
    ```
    """

    name: ClassVar[str] = "composed"
    clips_actions: ClassVar[bool] = True

    restarts: ClassVar[tuple[str, ...]] = ("body",)
    """Settings with which the others start from their defaults: terms belong to a body."""
    aliases: ClassVar[Mapping[str, str]] = {
        "observe": "observations",
        "reward": "rewards",
        "reset": "resets",
        "terminate": "terminations",
        "metrics": "metric_terms",
    }

    body: Any = static(
        None,
        option=False,
        plain=body_table,
        help="a body; the path of an MJCF file, MJCF as text, or a `mujoco.MjSpec`; or a table of `Mjcf`, or with the "
        "`kind` of another body",
    )
    observations: tuple[Observation | Quantity, ...] = static(
        (),
        option=False,
        help="what is observed, at least one term (`Observation`, or any `Quantity`). Short name: `observe`",
    )
    rewards: tuple[Quantity, ...] = static(
        (),
        option=False,
        help="what is rewarded, at least one term (`Quantity`), each with its `weight`. Short name: `reward`",
    )
    targets: tuple[Target, ...] = static((), option=False, help="what other terms refer to (`Target`)")
    resets: tuple[Reset, ...] = static(
        (),
        option=False,
        help="the state in which episodes start (`Reset`), by default the body's keyframe. Short name: `reset`",
    )
    terminations: tuple[Quantity, ...] = static(
        (),
        option=False,
        help="what ends an episode (`Quantity` with a limit, `above` or `below`). Short name: `terminate`",
    )
    metric_terms: tuple[Quantity, ...] = static(
        (), option=False, help="what is recorded (`Quantity`). Short name: `metrics`"
    )
    actions: Literal["continuous", "binary"] = static(  # pyright: ignore[reportIncompatibleVariableOverride]
        "continuous",
        help='`"continuous"` for controls in the actuators\' ranges; `"binary"` for units that are on or off, '
        "one for each muscle, and two that oppose each other for an actuator that works in both "
        "directions",
    )
    groups: tuple[str | tuple[str, ...], ...] | None = static(
        None,
        option=False,
        help='the actuators that each unit drives, a name or a pattern such as `"flexor*"`, or a list of them. '
        "Several binary units may drive the same ones. Actuators in no group stay at rest. By default each has its own "
        "unit",
    )
    scaling: Literal["running", "none"] = static(
        "running",
        help='scaling of observations: `"running"` subtracts the running mean of this seed\'s observations '
        'and divides by their standard deviation, clipped to ±5; `"none"` leaves them unchanged',
    )
    action_period: float = 0.02
    time_limit: float | None = None
    commands: Literal["controls", "sigmoid"] = static(
        "controls",
        help='what an action means. `"controls"`: controls in the actuators\' ranges. `"sigmoid"`, as in '
        "MyoSuite: numbers a in [−1, 1]. A muscle then has the control 1 / (1 + exp(−5 (a − 0.5))) "
        "and any other actuator a itself; on a body without muscles, −1 to 1 stand for the ends of "
        "each actuator's range. A binary unit gives −1 or 1",
    )
    terrain: Terrain | None = inner(
        None, help="uneven ground (`motorgrad.bodies.Terrain`) in place of the body's floor; by default as the body is"
    )

    def __post_init__(self) -> None:
        if self.body is None:
            for name, value in reach().items():
                if getattr(self, name) in ((), None):
                    object.__setattr__(self, name, value)
        object.__setattr__(self, "body", body_of(self.body))
        super().__post_init__()

    def validate(self) -> None:
        super().validate()
        check(self.observations, "observations", self.observations, "at least one term, given as `observe`")
        check(self.rewards, "rewards", self.rewards, "at least one term, given as `reward`")
        whole = self.commands == "controls" or self.groups is None
        check(whole, "groups", self.groups, "left out with the commands 'sigmoid'")
        names = self.metric_names
        for name in names:
            check(names.count(name) == 1, "name of a metric", name, "given once")
        for term in (*self.rewards, *self.metric_terms, *self.terminations):
            limited = term.above is not None or term.below is not None
            ends = term in self.terminations
            check(limited or not ends, f"terminate: {kind_of(term)}", "no limit", "above or below a limit")
        self._drive  # noqa: B018 (raises for unknown actuators)
        scene = self._bound.scene  # which raises for unknown names
        assert self.body is not None
        tell_if_few_can_be_held(self.body, scene.model)

    def __reduce__(self) -> tuple[Any, ...]:  # bound terms are functions, so they are made again
        return type(self), tuple(getattr(self, field.name) for field in dataclasses.fields(self))

    @classmethod
    def in_folder(cls, settings: Mapping[str, Any], folder: Path) -> dict[str, Any]:
        return with_absolute_paths(settings, folder)

    @functools.cached_property
    def _bound(self) -> _Bindings:
        body = self.body if self.terrain is None else OnTerrain(self.body, self.terrain)
        scene = Scene(body, self.action_period, self.targets)
        remembering: list[Bound] = []

        def bind(what: str, term: Observation | Quantity) -> Bound:
            found = bound(what, term, scene)
            found = found._replace(names=found.names or (_label(term),))
            if found.init is not None:
                remembering.append(found)
            return found

        observe = tuple((getattr(term, "scale", 1.0), bind("observe", term)) for term in self.observations)
        reward = tuple((term.weight, bind("reward", term)) for term in self.rewards)
        terminate = tuple((term, bind("terminate", term)) for term in self.terminations)
        metrics = tuple((_label(term), term.at_end, bind("metrics", term)) for term in self.metric_terms)
        reset = tuple(bound("reset", term, scene) for term in self.resets)
        return _Bindings(scene, scene.sensed, observe, reward, terminate, metrics, reset, tuple(remembering))

    @property
    def dynamics(self) -> Body:
        """The body, with the sensors that the terms need."""
        return self._bound.body

    # -- actions

    @functools.cached_property
    def _drive(self) -> Drive:
        opposed = self.actions == "binary" and self.commands == "controls"  # a command has two signs by itself
        return drive_of(Scene(self.body, self.action_period), self.groups, opposed)

    @property
    def action_size(self) -> int:
        return len(self._drive.names)

    @property
    def action_names(self) -> tuple[str, ...]:
        """What each unit drives."""
        return self._drive.names

    @property
    def action_range(self) -> tuple[tuple[float, float], ...]:
        if self.commands == "sigmoid":
            return ((-1.0 if self.actions == "continuous" else 0.0, 1.0),) * self.action_size
        return tuple((float(low), float(high)) for low, high in self._drive.range)

    def control(self, action: Float[AnyArray, "... units"], memory: PyTree = None) -> Float[AnyArray, "... groups"]:
        """The control of each group of actuators, within its range."""
        del memory
        drive = self._drive
        if self.commands == "sigmoid":
            command = jnp.clip(action, -1, 1) if self.actions == "continuous" else 2 * action - 1
            if not self._muscles.any():
                low, high = drive.limits.T
                return (low + high) / 2 + command * (high - low) / 2
            return jnp.where(self._muscles, 1 / (1 + jnp.exp(-5 * (command - 0.5))), command)
        if self.actions == "continuous":
            action = jnp.clip(action, *jnp.asarray(drive.range, jnp.float32).T)
        if drive.plain:
            return action
        return jnp.clip(drive.rest + action @ drive.matrix, *drive.limits.T)

    @functools.cached_property
    def _muscles(self) -> Bool[np.ndarray, " groups"]:
        return self._bound.scene.muscles

    # -- observations

    @property
    def observation_size(self) -> int:
        return len(self.observation_names)

    @property
    def observation_names(self) -> tuple[str, ...]:
        return tuple(name for _, each in self._bound.observe for name in each.names)

    @property
    def observation_units(self) -> tuple[str, ...]:
        return tuple(scaled(unit, scale) for scale, each in self._bound.observe for unit in units_of(each))

    def observe(
        self, memory: ComposedMemory, state: BodyState, uniforms: Float[Array, " 0"]
    ) -> tuple[ComposedMemory, Float[Array, " inputs"]]:
        memory, raw = self.sense(memory, state, uniforms)
        mean, variance, seen = self.observation_code.observe(memory.mean, memory.variance, memory.frozen, raw)
        return memory._replace(mean=mean, variance=variance), seen

    def sense(
        self, memory: ComposedMemory, state: BodyState, uniforms: Float[Array, " 0"]
    ) -> tuple[ComposedMemory, Float[Array, " inputs"]]:
        del uniforms
        read = self._reader(memory, state)
        return memory, jnp.concatenate([scale * jnp.atleast_1d(read(each)) for scale, each in self._bound.observe])

    @functools.cached_property
    def observation_code(self) -> ObservationCode:  # pyright: ignore[reportIncompatibleMethodOverride]
        return ObservationCode.plain(self.observation_names, self.scaling == "running")

    @functools.cached_property
    def goal(self) -> Goal | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """What the task aims at: see `goal_of`."""
        parts = self._bound
        return goal_of(self.observations, parts.observe, self.rewards, parts.scene)

    # -- episodes

    @property
    def init_uniforms(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        parts = self._bound
        return sum(t.uniforms for t in parts.scene.targets.values()) + sum(each.uniforms for each in parts.reset)

    @property
    def episodic(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return bool(self.terminations)

    def init(self, uniforms: Float[Array, " init_uniforms"]) -> ComposedMemory:
        parts = self._bound
        drawn = {}
        place = 0
        for name, target in parts.scene.targets.items():
            drawn[name] = target.draw(uniforms[place : place + target.uniforms])
            place += target.uniforms
        return ComposedMemory(
            jnp.zeros((), jnp.int32),
            jnp.zeros((), bool),
            jnp.zeros(len(self.body.groups)),
            drawn,
            tuple(each.init() for each in parts.remembering),
            *self.observation_code.start(),
            jnp.zeros((), bool),
        )

    def renew(self, memory: ComposedMemory, uniforms: Float[Array, " init_uniforms"]) -> ComposedMemory:
        return self.init(uniforms)._replace(mean=memory.mean, variance=memory.variance, frozen=memory.frozen)

    def freeze(self, memory: ComposedMemory) -> ComposedMemory:
        return memory._replace(frozen=jnp.ones((), bool))

    def begin(self, uniforms: Float[np.ndarray, "rows init_uniforms"]) -> Mapping[str, np.ndarray]:
        parts = self._bound
        if not parts.reset:
            return {}
        place = sum(target.uniforms for target in parts.scene.targets.values())
        start = Start(*(np.tile(each, (len(uniforms), 1)) for each in start_pose(self.body, parts.scene.model)))
        for each in parts.reset:
            start = each.apply(start, np.asarray(uniforms[:, place : place + each.uniforms], float))
            place += each.uniforms
        return {name: values for name, values in start._asdict().items() if values.shape[1]}

    def reward(
        self, memory: ComposedMemory, state: BodyState, action: Float[Array, " units"]
    ) -> tuple[ComposedMemory, Scalar, Flag]:
        parts = self._bound
        memory = memory._replace(decisions=counted_on(memory.decisions), control=self.control(action, memory))
        if parts.remembering:
            now = self._now(memory, state)
            pairs = zip(parts.remembering, memory.terms, strict=True)
            after = (each.step(now._replace(memory=own)) if each.step else own for each, own in pairs)
            memory = memory._replace(terms=tuple(after))
        read = self._reader(memory, state)
        reward = jnp.asarray(sum(weight * read(each) for weight, each in parts.reward))
        ended: Any = False
        for term, each in parts.terminate:
            value = read(each)
            if term.above is not None:
                ended |= value > term.above
            if term.below is not None:
                ended |= value < term.below
        limit = self.episode_limit
        over = ended if limit is None else (memory.decisions >= limit) | ended
        return memory._replace(ended=jnp.asarray(over)), reward, ended

    @property
    def reward_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        labels = [_label(term) for term in self.rewards]
        numbers = [labels[: place + 1].count(label) for place, label in enumerate(labels)]
        return tuple(label if n == 1 else f"{label} {n}" for label, n in zip(labels, numbers, strict=True))

    @property
    def reward_units(self) -> Mapping[str, str]:  # pyright: ignore[reportIncompatibleVariableOverride]
        units = [scaled(common(units_of(each)), weight) for weight, each in self._bound.reward]
        return dict(zip(self.reward_names, units, strict=True))

    def reward_terms(self, memory: ComposedMemory, state: BodyState) -> dict[str, Scalar]:
        """Each term times its weight; a further one of a name has its number, too."""
        read = self._reader(memory, state)
        terms = [jnp.asarray(weight * read(each)) for weight, each in self._bound.reward]
        return dict(zip(self.reward_names, terms, strict=True))

    # -- metrics

    @property
    def metric_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return tuple(_label(term) for term in self.metric_terms)

    @property
    def metric_units(self) -> Mapping[str, str]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return {name: common(units_of(each)) for name, _, each in self._bound.metrics}

    def metrics(self, memory: ComposedMemory, state: BodyState) -> dict[str, Metric]:
        """Those that were asked for."""
        read = self._reader(memory, state)
        return {name: (read(each), memory.ended if late else True) for name, late, each in self._bound.metrics}

    def marks(self, memory: ComposedMemory, state: BodyState) -> Float[Array, "marks 4"]:
        """Where parts of the body should be: balls with the radius of the smallest tolerance of a term."""
        now = self._now(memory, state)
        found = [jnp.zeros((0, 4))]
        for name, target in self._bound.scene.targets.items():
            if target.marked:
                at = target.at(now, name).reshape(-1, 3)
                terms = [term for term in (*self.rewards, *self.metric_terms) if getattr(term, "target", None) == name]
                radius = min((getattr(term, "tolerance", math.inf) for term in terms), default=math.inf)
                found.append(jnp.column_stack([at, jnp.full(len(at), radius if radius < math.inf else MARK)]))
        return jnp.concatenate(found)

    def _now(self, memory: ComposedMemory, state: BodyState) -> Now:
        n, period = memory.decisions, self.action_period
        return Now(state, memory.control, n * period, memory.drawn, decisions=n, period=period)

    def _reader(self, memory: ComposedMemory, state: BodyState) -> Callable[[Bound], Array]:
        """A function that reads a term, with what the term remembers."""
        now = self._now(memory, state)
        remembering = self._bound.remembering

        def read(bound: Bound) -> Array:
            if bound.init is None:
                return bound.read(now)
            place = next(i for i, each in enumerate(remembering) if each is bound)
            return bound.read(now._replace(memory=memory.terms[place]))

        return read


def compose(
    body: BodyLike,
    *,
    observe: Sequence[Any],
    reward: Sequence[Any],
    targets: Sequence[Any] = (),
    reset: Sequence[Any] = (),
    terminate: Sequence[Any] = (),
    metrics: Sequence[Any] = (),
    actions: Literal["continuous", "binary"] = "continuous",
    groups: Sequence[Any] | None = None,
    scaling: Literal["running", "none"] = "running",
    action_period: float = 0.02,
    time_limit: float | None = None,
    commands: Literal["controls", "sigmoid"] = "controls",
    terrain: Terrain | None = None,
) -> Composed:
    """A task on a body, put together from terms: an instance of `Composed`, which describes the arguments.

    A term is an instance of a class in `motorgrad.tasks.terms`; its name, such as `"joint-positions"`; or a table such
    as `{"kind": "within", "tolerance": 0.03}`.

    ```python
    task = mg.tasks.compose(
        "arm6",
        targets=["reach"],
        observe=["joint-positions", "joint-velocities", "target-error"],
        reward=["distance", {"kind": "effort", "weight": -0.1}],
        time_limit=2.0,
    )
    ```
    """
    terms = map(tuple, (observe, reward, targets, reset, terminate, metrics))
    units = None if groups is None else tuple(groups)
    return Composed(
        body,
        *terms,
        actions=actions,
        groups=units,
        scaling=scaling,
        action_period=action_period,
        time_limit=time_limit,
        commands=commands,
        terrain=terrain,
    )


def _label(term: Observation | Quantity) -> str:
    """The name of a quantity as a metric, or of the one number that an observation reads."""
    return getattr(term, "name", None) or kind_of(term)
