"""What learners share whose policy follows a gradient."""

from typing import Any

import jax.numpy as jnp

from motorgrad._errors import check
from motorgrad.learning._chain import Chain, Optax, Optimizer, Transformation
from motorgrad.learning._learner import Learner
from motorgrad.learning._schedules import Steps, changes
from motorgrad.policies import Policy
from motorgrad.schema import Part, inner


class GradientLearner(Learner):
    """A learner whose policy follows a gradient, by a chain of transformations. Its state has the fields `chain`, with
    their states, and `steps`. The fields `optimizer`, `transformations` and `averaging` are those of each learner, in
    the order of its arguments; it may have a `metric`, which comes first in the chain."""

    def validate(self) -> None:
        super().validate()
        own: Any = self
        for index, stage in enumerate(own.transformations):
            check(isinstance(stage, Transformation), f"transformations.{index}", stage, "a Transformation, or optax's")

    @property
    def stages(self) -> dict[str, Transformation]:
        """The gradient transformations by path, in their order."""
        own: Any = self
        further = {f"transformations.{index}": stage for index, stage in enumerate(own.transformations)}
        metric = getattr(self, "metric", None)
        found = {"metric": metric, "optimizer": own.optimizer, **further, "averaging": own.averaging}
        return {path: stage for path, stage in found.items() if stage is not None}

    @property
    def chain(self) -> Chain:
        """The gradient transformations, one after the other."""
        return Chain(tuple(self.stages.values()))

    def check_takes_every_gradient(self, sees_decisions: bool) -> None:
        """Refuse transformations that do not make a step of every gradient, such as a line search; and those that learn
        from decisions, where they are shown none (`sees_decisions`)."""
        name = type(self).__name__
        for path, stage in self.stages.items():
            kind = type(stage)
            wanted = f"one that makes a step of every gradient, such as SGD or Adam, for {name}"
            check(stage.steps_from == "any", path, kind.__name__, wanted)
            methods = ("observe", "solve", "restart")
            learns = any(getattr(kind, method) is not getattr(Transformation, method) for method in methods)
            wanted = f"one that reads gradients alone, for {name}, which shows it no decisions"
            check(sees_decisions or not learns, path, kind.__name__, wanted)

    def first_steps(self) -> Steps:
        """How many steps the parameters have made before the first decision; `None` where no part depends on it."""
        return jnp.zeros((), jnp.int32) if self.chain.needs_steps or changes(self.hyperparameters) else None

    def final_policy(self, state: Any) -> Policy:
        """The averaged policy if there is one, else the one that acts. States of many seeds are allowed."""
        return self.chain.final_policy(state.chain, state.policy)

    def set_policy(self, state: Any, policy: Policy) -> Any:
        """The state with another policy in place, from which averages begin anew. States of many seeds are allowed."""
        state = super().set_policy(state, policy)
        return state._replace(chain=self.chain.map(lambda stage, own: stage.reset(own, state.policy), state.chain))


def optimizer_field(default: Optimizer) -> Any:
    """Declare the field `optimizer` of a learner."""
    return inner(
        default,
        converter=as_transformation,
        help="how a gradient moves the parameters: `SGD`, `Adam`, or any optax transformation, which receives minus "
        "the gradient",
    )


def transformations_field() -> Any:
    """Declare the field `transformations` of a learner."""
    return inner(
        (),
        converter=lambda stages: tuple(map(as_transformation, stages)),
        help="further gradient transformations after the optimizer, ours or optax's",
    )


def averaging_field() -> Any:
    """Declare the field `averaging` of a learner."""
    return inner(
        None, help="none, or `PolyakAveraging` to keep the mean of the last parameters in place of the last ones"
    )


def as_transformation(value: Any) -> Any:
    """A transformation; one of optax's is wrapped."""
    foreign = not isinstance(value, Part) and hasattr(value, "init") and hasattr(value, "update")
    return Optax(value) if foreign else value
