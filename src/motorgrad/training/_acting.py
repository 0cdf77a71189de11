"""What a run does outside of its task: its policies act in the environment itself."""

import warnings
from typing import Any

import jax
import numpy as np
from jax.typing import ArrayLike

from motorgrad._errors import check
from motorgrad.policies import Actor, Policy, with_interface
from motorgrad.training.store import RunWarning


class Acting:
    """The part of a `Run` that is about acting in the environment itself, on raw observations."""

    @property
    def whole_policies(self: Any) -> Policy:
        """The `policies` with their interface, made again where an earlier version stored the run without it."""
        policies = self.policies
        if policies.interface is not None:
            return policies
        try:
            task = self.task
            interface = task.interface(jax.tree.map(lambda leaf: leaf[0], policies).actions)
            statistics = task.statistics(self.memory) if self._memory else None
        except (ValueError, RuntimeError) as error:
            why = " ".join(str(error).split())
            warnings.warn(
                f"{self.path or 'the run'}: its policies are without their interface: they see observations as the "
                f"task scales them, and `act` refuses: {why}",
                RunWarning,
                stacklevel=3,
            )
            return policies
        return with_interface(policies, interface.with_statistics(statistics))

    def act(
        self: Any, observation: ArrayLike, seed: int | None = None, uniforms: ArrayLike | None = None
    ) -> np.ndarray:
        """The raw action of a seed's policy for a raw observation, both as the environment has them; see `Policy.act`.

        **Arguments:** `observation`, in the environment's units; `seed`, whose policy acts, by default the first;
        `uniforms`, numbers from U[0, 1) by which the action is drawn, by default the most probable one.

        **Raises:** `ValueError` for a policy with a memory; `actor` keeps it.

        ```python
        environment = gymnasium.make("Pendulum-v1")
        observation, _ = environment.reset(seed=1)
        observation, *_ = environment.step(run.act(observation, seed=0))
        ```
        """
        actor = self.actor(seed)
        wanted = "without a memory; run.actor(seed) keeps it: actor = run.actor(), actor.act(observation)"
        check(not actor.policy.has_memory, "policy", type(actor.policy).__name__, wanted)
        return actor.act(observation, uniforms)

    def actor(self: Any, seed: int | None = None) -> Actor:
        """What acts in the environment itself by a seed's policy, and keeps its memory: `Actor(run.policy(seed))`."""
        actors = self._actors
        if seed not in actors:
            actors[seed] = Actor(self.policy(seed))
        return actors[seed] if not actors[seed].policy.has_memory else Actor(actors[seed].policy)
