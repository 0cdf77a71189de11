"""What learners share whose policy follows a gradient."""

import abc
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
    their states, and `steps`."""

    @property
    @abc.abstractmethod
    def chain(self) -> Chain:
        """The gradient transformations, in their order."""

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


def check_transformations(stages: tuple[object, ...]) -> None:
    """Refuse what is no transformation among the `transformations` of a learner."""
    for index, stage in enumerate(stages):
        check(isinstance(stage, Transformation), f"transformations.{index}", stage, "a Transformation, or optax's")


def check_any_gradient(optimizer: Optimizer, learner: str) -> None:
    """Refuse an optimizer that does not make a step of any gradient, for the class of a learner that gives several
    from the same decisions."""
    wanted = f"one that makes a step of every gradient, such as SGD or Adam, for {learner}"
    check(optimizer.steps_from == "any", "optimizer", type(optimizer).__name__, wanted)
