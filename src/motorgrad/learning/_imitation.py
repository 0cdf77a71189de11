"""Learning from demonstrations: a policy is fitted to what another one saw and did."""

import warnings
from collections.abc import Iterator
from typing import Any, Generic, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, PyTree

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, check_integer, check_positive
from motorgrad.learning._demonstrations import Demonstrations, check_imitates
from motorgrad.policies import Policy, abilities, split

P = TypeVar("P", bound=Policy)
RISE = 1e-4  # nats per decision: by less than this, the likelihood has not risen
MAX_BATCH = 1_000_000
MAX_PASSES = 1_000_000


class Imitation(NamedTuple, Generic[P]):
    """What `imitate` found.

    - `policy`: the fitted one, after the pass with the highest likelihood of what was held out.
    - `curve` (passes + 1,): the mean log-likelihood of a held-out decision, in nats, before and after every pass.
    - `best`: the pass after which the `policy` was taken; 0 for the policy as it was given.
    """

    policy: P
    curve: Float[np.ndarray, " passes+1"]
    best: int


def imitate(
    policy: P,
    demonstrations: Demonstrations,
    *,
    rate: float = 0.01,
    batch: int = 256,
    passes: int = 1000,
    patience: int = 10,
    held_out: float = 0.2,
    seed: int = 0,
) -> Imitation[P]:
    r"""Fit a policy to demonstrations by maximum likelihood, as behaviour cloning does (Pomerleau, 1991; supervised
    learning for imitation, section 7.1 of the thesis).

    Steps of Adam (Kingma & Ba, 2015) go up the mean of $\log\pi(a_t \mid y_t, \theta)$ over minibatches in random
    order. A part of the episodes is held out, of a single episode its end. Fitting ends once the mean log-likelihood of
    these has not risen by 1e-4 nats in `patience` passes, and returns the policy of its highest place.

    A policy with a memory is fitted to whole episodes: its memory begins anew in each, and the derivatives go through
    it. Inputs that a network standardises get the statistics of the demonstrated ones.

    A clone is as good as its demonstrator only where that has been. An error leads to where nothing was demonstrated,
    and so to more errors: their number may grow with the square of an episode's length (Ross & Bagnell, 2010).

    **Arguments:**

    - `policy`: any policy whose actions are all that it draws; where fitting begins. Its parameters alone change.
    - `demonstrations`: decisions of another policy, of a controller, or of a person.
    - `rate`: Adam's learning rate, above 0.
    - `batch`: decisions of a step; of a policy with a memory the episodes that have about as many, at least one.
    - `passes`: through all that is not held out, at most.
    - `patience`: passes without a rise after which it ends.
    - `held_out`: the share of the episodes that is held out, between 0 and 1, at least one and not all.
    - `seed`: of what is held out, and of the order.

    It warns where the likelihood of what is held out never rises, where it still rises after the last pass, and where
    it is no longer finite.

    **Raises:** `ValueError` for hidden units, whose draws nobody demonstrates; for a policy with a memory and
    statistics of its own; for observations or actions of other sizes; for actions that the policy cannot take, such as
    0.5 of a binary unit, or a number beyond the bounds of a graded one; and for too few decisions to hold any out.

    ```python
    run = mg.train("chain", steps=20_000, progress=False)
    shown = mg.rollout(run, steps=2_000).demonstrations()
    clone = mg.learning.imitate(mg.policies.softmax(run.task), shown).policy
    ```
    """
    check_arguments(imitate, locals(), ("demonstrations",))
    check(isinstance(policy, Policy), "policy", policy, "a policy, such as motorgrad.policies.hyperplanes(task)")
    check_positive("rate", rate)
    check_integer("batch", batch, 1, MAX_BATCH, "decisions")
    check_integer("passes", passes, 1, MAX_PASSES)
    check_integer("patience", patience, 1, MAX_PASSES)
    check(0 < held_out < 1, "held_out", held_out, "between 0 and 1")
    check_integer("seed", seed, 0, 2**31 - 1)
    check_imitates(policy, demonstrations)
    rng = np.random.default_rng(seed)
    taught, judged = _parted(demonstrations, held_out, abilities.has_memory(policy), rng)
    size = max(1, round(batch / taught.made.shape[1]))
    policy = _with_statistics(policy, taught)
    learned = _Fit(policy, size, rate)
    curve = [learned.likelihood(judged)]
    wanted = f"actions that {type(policy).__name__} can take"
    check(np.isfinite([*curve, learned.likelihood(taught)]).all(), "log-likelihood", curve[0], f"finite: {wanted}")
    best = rose = 0
    for number in range(1, passes + 1):
        learned.teach(taught, rng.permutation(len(taught.made)))
        curve.append(learned.likelihood(judged))
        if curve[-1] > curve[best]:
            best = number
            policy = learned.policy
        if curve[-1] >= curve[rose] + RISE:
            rose = number
        if number - rose >= patience or not np.isfinite(curve[-1]):
            break
    _warn(curve, best, rose, passes - rose < patience)
    return Imitation(policy, np.array(curve), best)


def _warn(curve: list[float], best: int, rose: int, rising: bool) -> None:
    """Say what may be wrong with a fit, whose likelihood `rose` at this pass for the last time."""
    of = "the log-likelihood of the decisions held out"
    if not np.isfinite(curve[-1]):
        message = f"{of} is {curve[-1]} after pass {len(curve) - 1}: fitting ends, with the policy of pass {best}"
    elif rising:
        message = f"{of} still rose when all {len(curve) - 1:,} passes were made: give more"
    elif rose == 0:
        message = f"{of} never rose above {curve[0]:.4g} by {RISE:g} or more: the policy is almost as it was given"
    else:
        return
    warnings.warn(message, stacklevel=3)


class _Sequences(NamedTuple):
    """Decisions in sequences that each begin without a memory: all arrays lead with (sequences, decisions). Shorter
    sequences repeat their last decision, which is not `made`."""

    observations: Float[np.ndarray, "sequences decisions observation"]
    actions: np.ndarray
    made: Bool[np.ndarray, "sequences decisions"]

    def batches(self, order: np.ndarray, size: int) -> Iterator["_Sequences"]:
        """Them in this order, so many `size` at a time. The last ones are filled up: all have one shape."""
        for first in range(0, len(order), size):
            chosen = order[first : first + size]
            filled = np.pad(chosen, (0, size - len(chosen)), mode="edge")
            made = self.made[filled] & (np.arange(size) < len(chosen))[:, None]
            yield _Sequences(self.observations[filled], self.actions[filled], made)


class _Fit:
    """A `policy` that is being fitted, by batches of so many sequences."""

    def __init__(self, policy: Policy, size: int, rate: float):
        self.policy: Any = policy
        self.size, self.rate = size, rate
        parameters: Any = split(policy)[0]
        self.state: PyTree = optax.scale_by_adam().init(parameters)

    def teach(self, taught: _Sequences, order: np.ndarray) -> None:
        """One pass."""
        for part in taught.batches(order, self.size):
            self.policy, self.state = _moved(self.policy, self.state, part, self.rate)

    def likelihood(self, judged: _Sequences) -> float:
        """The mean log-likelihood of a decision."""
        parts = judged.batches(np.arange(len(judged.made)), self.size)
        return sum(float(_log_likelihood(self.policy, part)) for part in parts) / int(judged.made.sum())


@eqx.filter_jit
def _log_likelihood(policy: Policy, rows: _Sequences) -> Float[Array, ""]:
    """The sum over all decisions."""

    def decide(memory: Array | None, decision: tuple[Array, Array]) -> tuple[Array | None, Array]:
        observation, action = decision
        seen = abilities.observation_with_memory(policy, memory, observation)
        return abilities.remember(policy, seen, action), policy.log_prob(seen, action)

    def of(observations: Any, actions: Any) -> Array:
        return jax.lax.scan(decide, abilities.initial_memory(policy), (observations, actions))[1]

    return jnp.sum(jnp.where(rows.made, jax.vmap(of)(rows.observations, rows.actions), 0.0))


@eqx.filter_jit
def _moved(policy: Policy, state: PyTree, rows: _Sequences, rate: Array | float) -> tuple[Policy, PyTree]:
    """The policy after a step of Adam up the mean log-likelihood."""
    parameters, rest = split(policy)

    def loss(learned: Policy) -> Array:
        return -_log_likelihood(eqx.combine(learned, rest), rows) / jnp.sum(rows.made)

    moves, state = optax.scale_by_adam().update(jax.grad(loss)(parameters), state)
    moves = abilities.allowed(policy, jax.tree.map(lambda move: -rate * move, moves))
    return abilities.limited(eqx.combine(eqx.apply_updates(parameters, moves), rest)), state


def _parted(
    demonstrations: Demonstrations, share: float, remembers: bool, rng: np.random.Generator
) -> tuple[_Sequences, _Sequences]:
    """What is taught and what is held out: as whole episodes for a policy that `remembers`, else decision by
    decision."""
    episodes = demonstrations.by_episode()
    if len(episodes) == 1:  # neighbours are alike: what is held out is to be apart from the rest
        total = len(demonstrations)
        check(total > 1, "demonstrations", demonstrations, "two decisions or more, to hold one out")
        check(not remembers, "demonstrations", demonstrations, "two episodes or more, for a policy with a memory")
        cut = total - min(max(round(share * total), 1), total - 1)
        parts = [[tuple(each[where] for each in episodes[0])] for where in (slice(cut), slice(cut, None))]
    else:
        order = rng.permutation(len(episodes))
        number = min(max(round(share * len(episodes)), 1), len(episodes) - 1)
        parts = [[episodes[k] for k in sorted(chosen)] for chosen in (order[number:], order[:number])]
    taught, judged = (_sequences(part, remembers) for part in parts)
    return taught, judged


def _sequences(episodes: list[Any], remembers: bool) -> _Sequences:
    """The sequences of some episodes, in the order of the decisions."""
    if not remembers:
        seen, done = (np.concatenate(parts)[:, None] for parts in zip(*episodes, strict=True))
        return _Sequences(seen, done, np.ones(seen.shape[:2], bool))
    lengths = np.array([len(seen) for seen, _ in episodes])
    most = int(lengths.max())
    places = [np.minimum(np.arange(most), length - 1) for length in lengths]
    seen, done = (
        np.stack([each[part][place] for each, place in zip(episodes, places, strict=True)]) for part in (0, 1)
    )
    return _Sequences(seen, done, np.arange(most) < lengths[:, None])


def _with_statistics(policy: P, taught: _Sequences) -> P:
    """The policy with the statistics of what is taught, if it keeps any."""
    if abilities.adapted(policy, jnp.zeros(policy.inputs)) is policy:
        return policy
    return _adapted(policy, jnp.asarray(taught.observations[:, 0]))


@eqx.filter_jit
def _adapted(policy: P, observations: Array) -> P:
    numbers, rest = eqx.partition(policy, eqx.is_array)

    def observe(before: PyTree, observation: Array) -> tuple[PyTree, None]:
        after = abilities.adapted(eqx.combine(before, rest), observation)
        return eqx.filter(after, eqx.is_array), None

    return eqx.combine(jax.lax.scan(observe, numbers, observations)[0], rest)
