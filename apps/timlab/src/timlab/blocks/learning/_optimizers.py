"""Optimizers as blocks: how a gradient becomes a step of the parameters."""

import dataclasses
import functools
from collections.abc import Hashable
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad import learning
from motorgrad._errors import check
from motorgrad.schema import Declared, Numbers, Range, count, number, static
from timlab.blocks.learning._parts import PartBlock
from timlab.blocks.learning._shared import MAX_PARAMETERS, Vector, is_paid, reads, where
from timlab.diagram import Block, Moment, Port, Ports, Signals


class OptimizerState(NamedTuple):
    """The optimizer's own state; the `parameters` before the step and the number of `steps`, where it needs them."""

    own: Any
    parameters: Float[Array, " size"] | None
    steps: Int[Array, ""] | None


@dataclasses.dataclass(frozen=True, kw_only=True)
class OptimizerBlock(PartBlock):
    """A number that may differ by group takes one value for all parameters, or one for each of `groups`; without
    `groups`, one for each parameter. There is a step at ticks that are `due`. An optimizer that depends on the
    parameters, as weight decay does, has an input for those of the units."""

    size: int = count(1, 1, MAX_PARAMETERS, help="number of parameters of the gradient")
    groups: tuple[int, ...] = static(
        (),
        allowed=Range(1, MAX_PARAMETERS, kind="int"),
        help="number of parameters in each group, in their order; none for one group",
    )
    frozen: Any = number(False, kind="bool", help="make no step: what was learned stays as it is")

    def validate(self) -> None:
        fits = not self.groups or sum(self.groups) == self.size
        check(fits, "groups", self.groups, f"none, or integers from 1 that add up to size = {self.size}")
        self.check_broadcasts("frozen", ())
        super().validate()

    def number_shape(self, declared: Declared) -> tuple[int, ...]:
        return (len(self.groups) or self.size,) if declared.groups else ()

    def number(self, name: str) -> Any:
        value = getattr(self, name)
        if not (self.parameters[name].groups and self.groups):
            return value
        each = jnp.broadcast_to(value, (len(self.groups),))
        return jnp.repeat(each, jnp.array(self.groups), total_repeat_length=self.size)

    @property
    def inputs(self) -> Ports:
        due = Port((), "bool", default=1.0, help="whether to step at this tick")
        ports = {"gradient": Port((self.size,)), "due": due}
        before = Port((self.size,), feedthrough=False, help="of the units, at this tick")
        return ports | ({"parameters": before} if self._reads_parameters else {})

    @property
    def outputs(self) -> Ports:
        return {"step": Port((self.size,))}

    @property
    def _reads_parameters(self) -> bool:
        optimizer = self.template
        return _reads_parameters(_Structure(optimizer, Numbers(optimizer).key))

    def init(self, uniforms: Float[Array, " 0"]) -> OptimizerState:
        zeros = jnp.zeros(self.size)
        return OptimizerState(
            self.bound_part.init(Vector(zeros)),
            zeros if self._reads_parameters else None,
            jnp.zeros((), jnp.int32) if self.part.needs_steps else None,  # type: ignore[attr-defined]
        )

    def output(self, state: OptimizerState, inputs: Signals, now: Moment) -> Signals:
        step, _ = self._updated(state, inputs, now)
        return {"step": jnp.where(self._is_due(inputs, now), step, 0)}

    def update(self, state: OptimizerState, inputs: Signals, now: Moment) -> OptimizerState:
        due = self._is_due(inputs, now)
        return OptimizerState(
            where(due, self._updated(state, inputs, now)[1], state.own),
            None if state.parameters is None else inputs["parameters"],
            None if state.steps is None else state.steps + due,
        )

    def _updated(self, state: OptimizerState, inputs: Signals, now: Moment) -> tuple[Float[Array, " size"], Any]:
        """The step for a gradient to be climbed, and the optimizer's state after it."""
        before = jnp.zeros(self.size) if state.parameters is None else state.parameters
        descent = Vector(-inputs["gradient"])
        due = self._is_due(inputs, now)
        step, after = self.bound_part.update(descent, state.own, Vector(before), state.steps, due)
        return step.parameters, after

    def _is_due(self, inputs: Signals, now: Moment) -> Any:
        return is_paid(inputs, now, "due") & ~self.frozen


class _Structure:
    """An optimizer that equals all of its structure."""

    def __init__(self, optimizer: learning.Optimizer, key: Hashable):
        self.optimizer, self.key = optimizer, key

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Structure) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


@functools.lru_cache(256)
def _reads_parameters(structure: _Structure) -> bool:
    """Whether the step depends on the parameters. An optimizer does not say so, but the traced function shows it."""
    optimizer = structure.optimizer

    def step(parameters: Array, gradient: Array) -> Any:
        state = optimizer.init(Vector(jnp.zeros(1)))  # type: ignore[arg-type]
        policy = Vector(parameters)  # type: ignore[arg-type]
        return optimizer.update(Vector(gradient), state, policy, jnp.zeros((), jnp.int32), True)  # type: ignore[arg-type]

    one = jax.ShapeDtypeStruct((1,), jnp.result_type(float))
    return reads(step, one, one)[0]


@dataclasses.dataclass(frozen=True)
class WeightDecay(Block):
    r"""Subtracts from a step the share of the parameters that decays, $-\lambda\theta$ (see `motorgrad.learning.SGD`).

    Wire the units' own `parameters` to it: it uses those before the step.
    """

    name: ClassVar[str] = "weight decay"
    category: ClassVar[str] = "learning"

    size: int = count(1, 1, MAX_PARAMETERS, help="number of parameters")
    decay: Any = number(1e-4, 0, 1, help=r"$\lambda$, for all or for each")

    def validate(self) -> None:
        self.check_broadcasts("decay", (self.size,))

    @property
    def inputs(self) -> Ports:
        return {"step": Port((self.size,)), "parameters": Port((self.size,), feedthrough=False)}

    @property
    def outputs(self) -> Ports:
        return {"step": Port((self.size,))}

    def init(self, uniforms: Float[Array, " 0"]) -> PyTree[Array]:
        return jnp.zeros(self.size)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        rule = learning.SGD(1.0, jnp.asarray(self.decay))  # type: ignore[arg-type]
        policy: Any = Vector(state)
        moves, _ = rule.update(Vector(-inputs["step"]), rule.init(policy), policy, None, True)
        return {"step": moves.parameters}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return inputs["parameters"]
