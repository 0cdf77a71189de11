"""What a learner knows, kept while its run acts without learning: engines have the policy alone then."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad.learning import Learner, Transition
from motorgrad.policies import Policy
from motorgrad.training import Stepper
from motorgrad.training.engines import CycleState

CARRIED = ("decision", "memory")
"""The fields of a learner's state that go on while nothing is learned, where it has them."""


class Kept(NamedTuple):
    """The learner's state, and the level of rewards that it has found, NaN where it finds none; seeds lead."""

    agent: Any
    baseline: Float[Array, " seeds"]

    @classmethod
    def of(cls, stepper: Stepper) -> "Kept":
        """What the learner of an engine knows. What was going on ends there, as an episode does in which the simulation
        diverged: the learner sees nothing of what follows, and must not credit it to what was before."""
        engine: Any = stepper  # every engine with a viewer has a cycle

        def ended(cycle: CycleState, state: PyTree) -> tuple[Any, Array]:
            learner = engine.cycle.learner(cycle)
            seen = cycle.observation
            raw = cycle.raw
            lost = Transition(
                seen, cycle.action, jnp.zeros(()), seen, diverged=jnp.asarray(True), raw=raw, next_raw=raw
            )
            goal = () if learner.needs.goal is None else (engine.cycle.goal(cycle.memory),)
            agent = learner.update(learner.observe(cycle.agent, lost), *goal)
            return agent, learner.readings(agent).get("baseline", jnp.asarray(jnp.nan))

        return cls(*stepper.viewer(ended)())

    def with_policy(self, learner: Learner, policy: Policy) -> "Kept":
        """The same where another policy was put in place."""
        return self._replace(agent=learner.set_policy(self.agent, jax.tree.map(jnp.array, policy)))

    def frozen(self, present: CycleState, frozen: Any) -> CycleState:
        """The present cycle for an engine that does not learn. `frozen` is any state of its learner."""
        agent = _carried(present.agent, frozen)
        return present._replace(agent=agent._replace(policy=self.agent.policy))

    def thawed(self, present: CycleState) -> CycleState:
        """The present cycle for an engine that learns."""
        return present._replace(agent=_carried(present.agent, self.agent))


def _carried(present: Any, into: Any) -> Any:
    """A learner's state with what goes on as it is at present."""
    both = (name for name in CARRIED if getattr(present, name, None) is not None and hasattr(into, name))
    return into._replace(**{name: getattr(present, name) for name in both})
