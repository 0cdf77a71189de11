"""A small world whose best policy is in the interior, and learning there judged by the exact average reward."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from motorgrad.learning import Agent
from motorgrad.policies import Softmax
from motorgrad.tasks import FiniteTask
from motorgrad.training import stepper_for
from motorgrad.worlds import FiniteMDP, oracle

WORTH = (1.0, 0.1)  # rewards of the two switches
BEST = sum(WORTH) / 4  # average reward of the best policy, which takes both actions equally often
FIRST = 2.0  # difference of the first weights of the two actions, at both switches


def hidden_switches() -> FiniteMDP:
    """Two switches, of which one stands before the learner at every decision, at random. It has two positions, which
    the learner does not see. The action that fits the position earns the switch's worth and throws the switch.

    An action taken always would fit at most once, so the best policy without a memory is undecided, and the curvature
    there is ten times as great along the parameters of one switch as of the other. At a three-state MDP, by contrast,
    the best policy is certain, and longer steps towards it are always better.
    """
    states = [(now, *positions) for now in range(2) for positions in np.ndindex(2, 2)]
    transitions = np.zeros((2, len(states), len(states)))
    rewards = np.zeros((2, len(states)))
    for row, (now, *positions) in enumerate(states):
        for action in range(2):
            after = list(positions)
            if action == positions[now]:
                after[now] = 1 - action
                rewards[action, row] = WORTH[now]
            for coming in range(2):
                transitions[action, row, states.index((coming, *after))] = 0.5
    return FiniteMDP(transitions, rewards, np.eye(2)[[now for now, *_ in states]])


@dataclasses.dataclass(frozen=True)
class HiddenSwitches(FiniteTask):
    """The hidden switches as a task without episodes."""

    name: ClassVar[str] = "hidden-switches"
    world: ClassVar[Any] = hidden_switches
    actions: ClassVar[Any] = "discrete"


def decided() -> Softmax:
    """The policy at first: it prefers the same action everywhere."""
    return Softmax(jnp.full((2, 2), FIRST / 2) * jnp.array([[1.0], [-1.0]]))


def earned(
    agent: Agent, seeds: Sequence[int], decisions: np.ndarray, read: Callable[[Any], np.ndarray] | None = None
) -> dict[str, Float[np.ndarray, "seeds records"]]:
    """The exact average reward at the hidden switches, `earned`, after each of these numbers of decisions, rising; and
    what is `read` of the learner's state, of all seeds, then."""
    stepper = stepper_for(HiddenSwitches(), agent, seeds)
    mdp = hidden_switches()
    found = []
    told = []
    for decision in decisions:
        stepper.advance(int(decision) - stepper.decision)
        policies: Any = stepper.policies()
        found.append([oracle.average_reward(mdp, Softmax(one)) for one in policies.weights])
        if read is not None:
            told.append(np.asarray(read(stepper.state["cycle"].agent)))
    return {"earned": np.array(found).T, **({} if read is None else {"read": np.array(told).T})}
