"""Search over policies: their parameters as named numbers, and what they earn as the score."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from motorgrad._errors import check, choice
from motorgrad.learning import Agent, Estimator
from motorgrad.policies import Policy, abilities, split
from motorgrad.schema import Settings, count, path_of, static
from motorgrad.search import Range, Space, WithGradients
from motorgrad.tasks import Task
from motorgrad.training._trust import task_named
from motorgrad.training.engines import mean_reward, stepper_for, validate, validate_needs


@dataclasses.dataclass(frozen=True, eq=False)
class PolicyScore(Settings):
    r"""What a policy earns, as a function of its parameters, for `motorgrad.search.search` and other optimisers.

    A candidate acts without learning for `steps` decisions in each of several *streams*, which have their own random
    numbers for the world's chances and for the policy's draws. Its score is the mean over the streams.

    With `fixed` streams, the candidates of all rounds meet the same random numbers (PEGASUS: Ng & Jordan, 2000). The
    score is then a deterministic function of the parameters,
    $\hat\eta(\theta) = \frac1m \sum_i \eta(\theta, \omega_i)$, and candidates differ by what they do and not by luck.
    An optimiser overfits the streams, the less the more there are. Otherwise every round has new streams, the same for
    all of its candidates.

    **Raises:** `ValueError` for a policy that does not fit the task, and for values out of range.

    ```python
    score = PolicyScore("chain", mg.policies.softmax(mg.make("chain")), steps=200)
    found = search(score, score.space(), EvolutionStrategy(), evaluations=640)
    policy = score.policy_of(found.best)
    ```
    """

    task: Any = static(help="a task, or the name of one")
    policy: Any = static(help="a policy, from whose parameters the search starts, or a function from a key to one")
    steps: int = count(1000, 1, unit="decisions", help="length of each candidate's run in each stream")
    streams: int = count(8, 1, help="number of streams of random numbers")
    fixed: bool = static(True, help="whether the streams are the same in all rounds")
    seed: int = count(0, help="seed of the first stream, if they are fixed; the others follow it")
    of: str = static("reward", help="mean reward per decision, or the task's metric of this name, where it occurred")
    gradient: Estimator | None = static(
        None,
        help="none, or an estimator of the gradient at fixed parameters, such as `gpomdp(0.9)`. The score then "
        "comes `WithGradients` of the mean reward from the same decisions: the mean of the streams' "
        "estimates, and the variance of that mean as the streams' differences show it. It needs at least "
        "two streams. The estimates have the estimator's bias, which the variances do not contain",
    )

    def validate(self) -> None:
        task = task_named(self.task) if isinstance(self.task, str) else self.task
        check(isinstance(task, Task), "task", task, "a task, or the name of one")
        made: Any = self.policy
        if not isinstance(made, Policy) and callable(made):
            made = made(jax.random.key(0))
        check(isinstance(made, Policy), "policy", self.policy, "a policy, or a function from a key to one")
        validate(task, made)
        object.__setattr__(self, "task", task)
        object.__setattr__(self, "policy", made)
        check(self.seed < 2**31 - self.streams, "seed", self.seed, f"at most {2**31 - 1 - self.streams:,}")
        choice("of", self.of, ("reward", *task.metric_names))
        if self.gradient is not None:
            check(self.gradient.update_every == "never", "gradient.update_every", self.gradient.update_every, '"never"')
            check(self.of == "reward", "of", self.of, '"reward" where a gradient is estimated')
            check(self.streams > 1, "streams", self.streams, "at least 2 where a gradient is estimated")
            validate_needs(task, Agent(made, self.gradient))

    def space(self, reach: float = 3.0) -> Space:
        """One number for each trainable parameter, by its path: at most `reach` > 0 from the policy's own, from which
        the search starts."""
        check(0 < reach < np.inf, "reach", reach, "a finite number above 0")
        ranges = {}
        for path, leaf in jax.tree_util.tree_leaves_with_path(split(self.policy)[0]):
            for index, value in np.ndenumerate(np.asarray(leaf, float)):
                name = ".".join([path_of(path), *map(str, index)])
                ranges[name] = Range(value - reach, value + reach, value)
        return Space(ranges)

    def policy_of(self, candidate: dict[str, float]) -> Policy:
        """The policy with the parameters of a candidate, within their limits."""
        return self._policy(jnp.asarray(self._numbers(candidate)))

    def __call__(
        self, candidates: Sequence[dict[str, float]], random: np.random.Generator
    ) -> np.ndarray | WithGradients:
        fixed = np.arange(self.seed, self.seed + self.streams)
        streams = fixed if self.fixed else random.integers(2**31 - 1, size=self.streams)
        rows = np.array([self._numbers(each) for each in candidates])
        policies = jax.vmap(self._policy)(jnp.asarray(np.repeat(rows, self.streams, axis=0)))
        seeds = np.tile(streams, len(rows)).tolist()
        agent = Agent(self.policy) if self.gradient is None else Agent(self.policy, self.gradient)
        mode = "sample" if self.gradient is None else "learn"
        stepper = stepper_for(self.task, agent, seeds, mode, initial=policies)
        stepper.advance(self.steps)
        found = stepper.harvest()
        earned = mean_reward(found, self.steps) if self.of == "reward" else found[self.of]
        earned = np.asarray(earned, float).reshape(len(rows), self.streams)
        known = np.isfinite(earned)
        some = known.any(axis=1) if self.of != "reward" else known.all(axis=1)
        scores = np.where(some, np.where(known, earned, 0).sum(axis=1) / np.maximum(known.sum(axis=1), 1), np.nan)
        if self.gradient is None:
            return scores
        mean = stepper.state["cycle"].agent.gradient.mean
        leaves = [np.asarray(leaf, float).reshape(*earned.shape, -1) for leaf in jax.tree.leaves(mean)]
        order = [self._names.index(name) for name in candidates[0]]
        samples = np.concatenate(leaves, axis=-1)[..., order]
        return WithGradients(scores, samples.mean(axis=1), samples.var(axis=1, ddof=1) / self.streams)

    @functools.cached_property
    def _names(self) -> tuple[str, ...]:
        return self.space().names

    def _numbers(self, candidate: dict[str, float]) -> list[float]:
        """The numbers of a candidate in the order of the parameters."""
        same = candidate.keys() == set(self._names)
        check(same, "candidate", list(candidate), "a number for each name of the space")
        return [candidate[name] for name in self._names]

    def _policy(self, parameters: Float[Array, " size"]) -> Policy:
        learned, settings = split(self.policy)
        flat, restore = ravel_pytree(learned)
        return abilities.limited(eqx.combine(restore(parameters.astype(flat.dtype)), settings))
