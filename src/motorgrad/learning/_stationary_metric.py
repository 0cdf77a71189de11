r"""The natural gradient of states and actions together (Morimura, Uchibe, Yoshimoto & Doya, 2008, 2009).

The Fisher matrix of `FisherMetric`, $F_a$, measures how far a step changes the actions in each state. A step also
changes which states are visited. The Fisher matrix of states and actions together is

$$F_a + \mathbb E[\xi\xi'], \qquad \xi(y) = \nabla\log\pi_y,$$

with $\xi$ the gradient of the logarithm of a state's stationary probability. It has a recursion backwards in time. A
state is as probable as all that leads to it, so

$$\xi(y_{t+1}) = \mathbb E[\xi(y_t) + \psi_t \mid y_{t+1}], \qquad \mathbb E\,\xi = 0,$$

with the score $\psi_t = \nabla\log\pi(a_t \mid y_t)$. Least squares solve it from experience, as LSTD does for
values: LSLSD(λ) (Morimura, Uchibe, Yoshimoto, Peters & Doya, 2010).
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float

from motorgrad._branching import Flag, where, where_any
from motorgrad._linear_algebra import linear_solve
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._chain import Updates
from motorgrad.learning._critics import Features, check_blind
from motorgrad.learning._learner import Transition
from motorgrad.learning._natural import Blocks, Metric, identities, zeros_of
from motorgrad.learning._schedules import Steps
from motorgrad.policies import Policy, abilities, trainable
from motorgrad.schema import inner, number


class Backward(NamedTuple):
    r"""Means over decisions: $\overline{\phi\,(\phi - u)'}$, $\overline{\phi z'}$, $\overline\phi$ and
    $\overline{\phi\phi'}$."""

    matrix: Float[Array, "features features"]
    products: Float[Array, "features parameters"]
    feature: Float[Array, " features"]
    squares: Float[Array, "features features"]


class StationaryState(NamedTuple):
    r"""The running Fisher matrix of actions, in `blocks`; the running means of `Backward`. Of the decisions before: the
    features $u$ that the recursion refers to and the scores $z$ since then, where there are `any`."""

    blocks: RunningMean
    backward: RunningMean
    earlier: Float[Array, " features"]
    scores: Float[Array, " parameters"]
    any: Bool[Array, ""]


class StationaryMetric(Metric):
    r"""The Fisher matrix of states and actions together, whose inverse multiplies the gradient (Morimura et al., 2009).

    The direction of a step is $(F_a + \iota\,\mathbb E[\xi\xi'] + dI)^{-1} g$. $F_a$ is the running mean of
    `abilities.fisher`. $\xi(y) = \Omega'\phi(y)$ is linear in features, and $\Omega$ solves

    $$\big(\overline{\phi_t\,(\phi_t - u_t)'} + \overline\phi\,\overline\phi' + \epsilon I\big)\,\Omega =
    \overline{\phi_t z_t'}, \quad u_{t+1} = (1 - \lambda)\,\phi_t + \lambda u_t, \quad z_{t+1} = \psi_t + \lambda z_t.$$

    All parameters of a policy share one matrix, as what one unit does changes the states that all of them see. The end
    of an episode counts as a transition to the start of the next.

    The paper finds the direction by an estimating function, without a gradient estimate. Here the matrix is formed and
    the system solved, so the gradient is that of any estimator.

    **Raises:** `ValueError` for a value out of range, for features that see the previous action, for a learner that
    grows and for several `envs`; from `init`, for a policy with more than 4,096 parameters.

    ```python
    metric = mg.learning.StationaryMetric(weight=1.0, rate=1e-3)
    agent = mg.Agent(mg.policies.softmax(task), mg.learning.olgarb(0.9), mg.learning.SGD(0.01), metric)
    ```
    """

    single_stream: ClassVar[bool] = True  # a decision is compared with the one before it
    takes_growth: ClassVar[bool] = False

    features: Features = inner(
        Features(), help=r"$\phi$, without the previous action. They should tell the states apart"
    )
    weight: float = number(
        1.0,
        0,
        1,
        help=r"$\iota$, the share of the states. 0 is the natural gradient of actions alone (Kakade, 2001), 1 that of "
        r"the joint distribution (Morimura et al., 2008)",
    )
    decay: float = number(
        0.0,
        0,
        1,
        open_high=True,
        help=r"$\lambda$. The longer, the less it matters that $\phi$ cannot tell all states apart, and the noisier "
        r"$\xi$ is",
    )
    rate: float = number(
        1e-3, 0, 1, help=r"the n-th decision moves the means by $\max(1/n, \text{rate})$ of its distance"
    )
    damping: float = number(
        0.01, 0, open_low=True, help="$d$, in the units of the Fisher matrix, one over the square of a parameter's"
    )
    ridge: float = number(1e-3, 0, open_low=True, help=r"$\epsilon$, in the units of a squared feature")
    initial: float = number(
        1.0,
        0,
        at_start=True,
        help="first diagonal, in the units of the Fisher matrix. $F_a$ starts as this times the identity, which "
        "counts as one decision",
    )

    def validate(self) -> None:
        check_blind(self.features)

    def init(self, policy: Policy) -> StationaryState:
        zeros = zeros_of(policy)
        blocks = tuple(identities(block, self.initial) for block in abilities.blocks(policy, trainable(policy)))
        started = running_mean(blocks)._replace(mean=blocks)
        phi = jnp.zeros_like(self.features(abilities.critic_observation(policy, jnp.zeros(policy.inputs, zeros.dtype))))
        square = jnp.zeros((phi.size, phi.size), zeros.dtype)
        means = running_mean(Backward(square, jnp.zeros((phi.size, zeros.size), zeros.dtype), phi, square))
        return StationaryState(started._replace(count=started.count + 1), means, phi, zeros, jnp.zeros((), bool))

    def observe(self, state: StationaryState, policy: Policy, transition: Transition) -> StationaryState:
        observation, action = transition.observation, transition.action
        phi = self.features(abilities.critic_observation(policy, observation)).astype(state.earlier.dtype)
        score = ravel_pytree(policy.score(observation, action))[0]
        blocks = add_sample(state.blocks, abilities.fisher(policy, observation, action), self.rate)
        outer = phi[:, None]
        sample = Backward(outer * (phi - state.earlier), outer * state.scores, phi, outer * phi)
        backward = where(state.any, add_sample(state.backward, sample, self.rate), state.backward)
        fade = jnp.where(state.any, self.decay, 0).astype(phi.dtype)
        earlier = (1 - fade) * phi + fade * state.earlier
        scores = score + fade * state.scores
        after = StationaryState(blocks, backward, earlier, scores, jnp.ones((), bool))
        return where(transition.diverged, state._replace(any=jnp.zeros((), bool)), after)

    def solution(self, state: StationaryState) -> Float[Array, "features parameters"]:
        r"""$\Omega$, the weights of $\xi$; 0 where the system has none yet."""
        matrix, products, feature, _ = state.backward.mean
        whole = matrix + feature[:, None] * feature + self.ridge * jnp.eye(feature.size, dtype=feature.dtype)
        found = linear_solve(whole, products)
        return jnp.where(jnp.all(jnp.isfinite(found)), found, 0)

    def stationary_score(
        self, state: StationaryState, observation: Float[Array, " inputs"]
    ) -> Float[Array, " parameters"]:
        r"""$\xi(y)$, the gradient of the logarithm of a state's stationary probability, as one vector."""
        return self.features(observation).astype(state.earlier.dtype) @ self.solution(state)

    def fisher(self, state: StationaryState, policy: Policy) -> Float[Array, "parameters parameters"]:
        r"""$F_a + \iota\,\mathbb E[\xi\xi']$."""
        unravel = ravel_pytree(trainable(policy))[1]

        def product(vector: Array) -> Array:
            parts = zip(state.blocks.mean, abilities.blocks(policy, unravel(vector)), strict=True)
            rows: Blocks = tuple((block * row[:, None, :]).sum(-1) for block, row in parts)
            return ravel_pytree(abilities.from_blocks(policy, rows))[0]

        weights = self.solution(state)
        means = state.backward.mean
        varying = means.squares - means.feature[:, None] * means.feature
        return jax.vmap(product)(jnp.eye(weights.shape[1], dtype=weights.dtype)) + (
            self.weight * weights.T @ varying @ weights
        )

    def update(
        self, updates: Updates, state: StationaryState, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, StationaryState]:
        def direction(given: Updates) -> Updates:
            # The barrier keeps the compiler from solving ahead of the loop in `where_any`.
            known, acting, given = jax.lax.optimization_barrier((state, policy, given))
            vector, unravel = ravel_pytree(given)
            matrix = self.fisher(known, acting) + self.damping * jnp.eye(vector.size, dtype=vector.dtype)
            return unravel(linear_solve(matrix, vector))

        return where_any(due, direction, updates), state
