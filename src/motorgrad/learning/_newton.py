r"""Newton steps: the curvature of the average reward, estimated from scores and traces (section 3.1 of the thesis).

What scores are to the gradient, $\nabla^2\log\pi + \nabla\log\pi\,(\nabla\log\pi)'$ is to the Hessian: both have the
mean 0 in every state, and multiplied by later rewards they show what the reward depends on. With the trace
$z_t = \beta z_{t-1} + s_t$ of the scores $s$, a second trace follows matrices,

$$M_t = \beta M_{t-1} + \nabla^2\log\pi_t + s_t s_t' + \beta\,(s_t z_{t-1}' + z_{t-1} s_t'),$$

and $\mathbb E[(r_{t+1} - b)\,M_t]$ tends to the Hessian of the average reward as $\beta$ tends to 1, as GPOMDP tends to
the gradient. The last term, of pairs of decisions, is the noisiest. Without it the matrix is the part
$\mathcal A_1 + \mathcal A_2$ of the approximate Newton methods of Furmston, Lever & Barber (2016), which play the part
of Gauss & Newton's in policy search.
"""

from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from motorgrad._branching import Flag, where, where_any
from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._chain import Updates
from motorgrad.learning._learner import Transition
from motorgrad.learning._natural import Metric, zeros_of
from motorgrad.learning._schedules import Steps
from motorgrad.policies import Policy, split
from motorgrad.schema import number, static

MAX_PARAMETERS = 256
"""Every decision moves two matrices of their square."""
Matrix = Float[Array, "parameters parameters"]


class NewtonState(NamedTuple):
    """The running mean of the `hessian`, that of rewards, `level`, the trace of scores, `scores`, and that of matrices,
    `curvatures`."""

    hessian: RunningMean
    level: RunningMean
    scores: Float[Array, " parameters"]
    curvatures: Matrix


class NewtonMetric(Metric):
    r"""Newton's step, $(|H| + d)^{-1} g$ with the estimated Hessian $H$ of the average reward.

    $|H|$ has the eigenvectors of $H$ and the sizes of its eigenvalues, so that a step goes uphill also where the
    reward is not concave (Dauphin et al., 2014). It is a method for few parameters and long batches: a Hessian is much
    noisier than a gradient.

    **Raises:** `ValueError` for a value out of range; from `init`, for a policy with more than 256 parameters.
    """

    decay: float = number(
        0.9, 0, 1, open_high=True, help=r"$\beta$ of both traces, per decision, as a rule that of the gradient's"
    )
    terms: Literal["whole", "approximate"] = static(
        "whole",
        help="whole for the Hessian; approximate without the products of the scores of two decisions, less noisy but "
        "biased",
    )
    rate: float = number(
        1e-3, 0, 1, open_low=True, help=r"the n-th decision moves $H$ by $\max(1/n, \text{rate})$ of its distance"
    )
    damping: float = number(
        0.01, 0, open_low=True, help="$d$, in the units of $H$, those of reward over the square of a parameter's"
    )

    def init(self, policy: Policy) -> NewtonState:
        zeros = zeros_of(policy)
        few = f"one of at most {MAX_PARAMETERS} parameters"
        check(zeros.size <= MAX_PARAMETERS, "policy", f"{type(policy).__name__} of {zeros.size:,} parameters", few)
        square = jnp.zeros((zeros.size, zeros.size), zeros.dtype)
        return NewtonState(running_mean(square), running_mean(zeros[0]), zeros, square)

    def observe(self, state: NewtonState, policy: Policy, transition: Transition) -> NewtonState:
        score, slope = _score_and_slope(policy, transition.observation, transition.action)
        now = slope + score[:, None] * score
        faded = (self.decay * state.scores).astype(score.dtype)
        if self.terms == "whole":
            now = now + score[:, None] * faded + faded[:, None] * score
        curvatures = (self.decay * state.curvatures + now).astype(score.dtype)
        error = transition.reward - state.level.mean
        after = NewtonState(
            add_sample(state.hessian, (error * curvatures).astype(score.dtype), self.rate),
            add_sample(state.level, transition.reward.astype(score.dtype), self.rate),
            faded + score,
            curvatures,
        )
        return where(transition.diverged, state, after)

    def restart(self, state: NewtonState, ended: Flag) -> NewtonState:
        begun = state._replace(scores=jnp.zeros_like(state.scores), curvatures=jnp.zeros_like(state.curvatures))
        return where(ended, begun, state)

    def precondition(self, state: NewtonState, gradient: Float[Array, " parameters"]) -> Float[Array, " parameters"]:
        r"""$(|H| + d)^{-1} g$."""
        values, vectors = jnp.linalg.eigh(state.hessian.mean)
        return vectors @ ((vectors.T @ gradient) / (jnp.abs(values) + self.damping))

    def update(
        self, updates: Updates, state: NewtonState, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, NewtonState]:
        def direction(given: Updates) -> Updates:
            # The barrier keeps the compiler from decomposing ahead of the loop in `where_any`.
            known, given = jax.lax.optimization_barrier((state, given))
            vector, unravel = ravel_pytree(given)
            return unravel(self.precondition(known, vector).astype(vector.dtype))

        return where_any(due, direction, updates), state


def _score_and_slope(policy: Policy, observation: Array, action: Array) -> tuple[Array, Matrix]:
    r"""$\nabla\log\pi(a \mid y)$ and $\nabla^2\log\pi$. The analytic score is differentiated, because it is defined
    also where automatic derivatives of a probability are not."""
    learned, settings = split(policy)
    vector, build = ravel_pytree(learned)

    def score(theta: Array) -> tuple[Array, Array]:
        found = ravel_pytree(eqx.combine(build(theta), settings).score(observation, action))[0].astype(theta.dtype)
        return found, found

    slope, found = jax.jacfwd(score, has_aux=True)(vector)
    return found, slope
