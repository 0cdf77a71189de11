"""Ascent rules: how a gradient estimate moves the parameters.

Any optax transformation will do; it receives minus the gradient, as optax minimises. The rules here add one thing to
optax's: a step size, and a decay, for every group of parameters, kept as data in the state, so that it may change over
time.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np
import optax
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad._groups import by_group, check_groups


class SgdState(NamedTuple):
    """`rates`: the step size of every parameter, a pytree of the parameters' structure with broadcastable leaves."""

    rates: PyTree[Array]


@dataclasses.dataclass(frozen=True)
class sgd:
    r"""Steepest ascent, $\theta \leftarrow \theta + \alpha g$, with one step size or one for every group.

    **Arguments:** `rate`, a number of at least 0; or a mapping from the names of the policy's fields to numbers or
    arrays that broadcast to the field, such as `{"centre": 2e-4, "log_width": 8e-4}`. In a policy of several pools a
    name stands for that field in every pool.

    **Raises:** `ValueError` for a rate that is negative, infinite or no number; from `init`, for a field without a
    rate, a rate without a field, or one whose shape does not fit its field.

    It is an optax transformation: it goes where one goes, into `optax.chain` too.
    """

    rate: float | Mapping[str, Any]

    def __post_init__(self) -> None:
        check_groups("step size", "rate", self.rate)

    def init(self, params: PyTree[Array]) -> SgdState:
        return SgdState(by_group("step size", "rate", self.rate, params))

    def update(self, updates: PyTree[Array], state: SgdState, params: Any = None) -> tuple[PyTree[Array], SgdState]:
        del params
        return jax.tree.map(lambda g, rate: -rate * g, updates, state.rates), state

    def __iter__(self) -> Iterator[Any]:  # optax.chain takes a transformation apart as the pair that optax's own are
        return iter((self.init, self.update))


@dataclasses.dataclass(frozen=True)
class adam:
    """Adam (Kingma & Ba, 2015) with one step size or one for every group, as in `sgd`, and its two decays."""

    rate: float | Mapping[str, Any]
    b1: float = 0.9
    b2: float = 0.999

    def __post_init__(self) -> None:
        for name in ("b1", "b2"):
            check(0 <= getattr(self, name) < 1, name, getattr(self, name), "in [0, 1)")
        self._chain()

    def _chain(self) -> optax.GradientTransformation:
        scale: Any = sgd(self.rate)
        return optax.chain(optax.scale_by_adam(b1=self.b1, b2=self.b2), scale)

    def init(self, params: PyTree[Array]) -> Any:
        return self._chain().init(params)

    def update(self, updates: PyTree[Array], state: Any, params: Any = None) -> tuple[PyTree[Array], Any]:
        return self._chain().update(updates, state, params)

    def __iter__(self) -> Iterator[Any]:  # as in `sgd`
        return iter((self.init, self.update))


class DecayState(NamedTuple):
    """`rule`: the state of the rule beneath; `decays`: the decay of every parameter, shaped as `SgdState.rates`."""

    rule: Any
    decays: PyTree[Array]


@dataclasses.dataclass(frozen=True)
class decayed:
    r"""Another rule, with parameters that decay: $\theta \leftarrow \theta + \Delta\theta - \lambda\theta$.

    The decay is decoupled (Loshchilov & Hutter, 2019): neither step size, metric nor momentum changes it. It acts at
    every step of the parameters, so for a learner that moves them once a batch it is per batch. Decaying gains keep
    units stochastic, and so exploring (section 4.4.1 of the thesis).

    **Arguments:**

    - `rule`: the rule that makes the move $\Delta\theta$: `sgd`, `adam`, or any optax transformation.
    - `decay` $\lambda \in [0, 1]$, per step of the parameters: a number for all; or a mapping from the names of the
      policy's fields to numbers or arrays that broadcast to the field. Groups left out do not decay. In single
      precision, a parameter that nothing else moves does not decay by less than some 1e-7 a step.

    **Raises:** `ValueError` for a decay out of its range; from `init`, for one without a field, or whose shape does not
    fit its field.
    """

    rule: Any
    decay: float | Mapping[str, Any]

    def __post_init__(self) -> None:
        made = hasattr(self.rule, "init") and hasattr(self.rule, "update")
        check(made, "rule", self.rule, "an optax transformation, such as motorgrad.learning.sgd(1e-3)")
        check_groups("weight decay", "of all", self.decay)
        for group, value in self.decay.items() if isinstance(self.decay, Mapping) else [("of all", self.decay)]:
            check(bool(np.all(np.asarray(value) <= 1)), f"weight decay {group}", value, "at most 1")

    def init(self, params: PyTree[Array]) -> DecayState:
        return DecayState(self.rule.init(params), by_group("weight decay", "of all", self.decay, params, default=0.0))

    def update(
        self, updates: PyTree[Array], state: DecayState, params: PyTree[Array]
    ) -> tuple[PyTree[Array], DecayState]:
        moves, rule = self.rule.update(updates, state.rule, params)
        moves = jax.tree.map(lambda move, decay, p: move - decay * p, moves, state.decays, params)
        return moves, state._replace(rule=rule)

    def __iter__(self) -> Iterator[Any]:  # as in `sgd`
        return iter((self.init, self.update))
